# SPDX-License-Identifier: Apache-2.0
"""Figures against python-control, and against motions whose figures are known."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import pytest

from control_board_ros.recording.figures import (
    bandwidth,
    frequency_response,
    lag,
    resonance,
    settling_time,
    step_figures,
    time_saturated,
    tracking_figures,
)

#: ω²/(s² + 2ζωs + ω²) of several dampings, and a system with a zero: numerator, denominator.
SYSTEMS = {
    "overdamped": ([100.0], [1.0, 40.0, 100.0]),
    "aperiodic": ([100.0], [1.0, 20.0, 100.0]),
    "usual": ([100.0], [1.0, 14.0, 100.0]),
    "ringing": ([100.0], [1.0, 3.0, 100.0]),
    "with a zero": ([10.0, 100.0], [1.0, 14.0, 100.0]),
}
SYSTEM = pytest.mark.parametrize("system", SYSTEMS.values(), ids=list(SYSTEMS))


@pytest.fixture(scope="module")
def control() -> Any:
    """python-control, imported late: it takes two seconds, and every worker collects this file."""
    return importlib.import_module("control")


@pytest.mark.slow
@SYSTEM
def test_step_figures_are_those_of_python_control(
    control: Any, system: tuple[list[float], list[float]]
) -> None:
    """Of a step from 2 down to −1, at a fine grid: rise, settling, overshoot."""
    time = np.arange(0.0, 6.0, 1e-4)
    _, y = control.step_response(control.tf(*system), time)
    known = control.step_info(y, time, SettlingTimeThreshold=0.02, yfinal=1.0)
    found = step_figures(time, 2.0 - 3.0 * y, 2.0, -1.0)
    assert found.rise == pytest.approx(known["RiseTime"], abs=2e-4)
    assert found.settling == pytest.approx(known["SettlingTime"], abs=2e-4)
    assert found.overshoot == pytest.approx(known["Overshoot"], abs=1e-3)
    assert found.peak == pytest.approx(2.0 - 3.0 * known["Peak"], abs=1e-4)


def test_a_coarse_grid_costs_little(control: Any) -> None:
    """At 100 Hz the figures are within a tenth of the period: crossings are interpolated."""
    usual = control.tf(*SYSTEMS["usual"])
    fine, coarse = np.arange(0.0, 3.0, 1e-4), np.arange(0.0, 3.0, 1e-2)
    figures = [
        step_figures(t, control.step_response(usual, t)[1], 0.0, 1.0) for t in (fine, coarse)
    ]
    assert figures[1].rise == pytest.approx(figures[0].rise, abs=1e-3)
    assert figures[1].settling == pytest.approx(figures[0].settling, abs=1e-3)


def test_moves_that_never_arrive_have_no_figures() -> None:
    time = np.linspace(0.0, 1.0, 101)
    found = step_figures(time, 0.5 * time, 0.0, 1.0)
    assert np.isnan([found.rise, found.settling]).all()
    assert found.overshoot == 0.0
    assert np.isnan(step_figures(time, time, 1.0, 1.0).rise)
    assert settling_time(time, np.zeros(101), 0.02) == 0.0


@pytest.mark.parametrize("late", [0.0, 0.0234, 0.2, -0.03])
def test_lag_of_a_delayed_motion(late: float) -> None:
    """Between samples, too, and ahead of the reference."""
    time = np.arange(0.0, 3.0, 0.01)
    reference = np.sin(2.0 * time)
    assert lag(time, reference, np.sin(2.0 * (time - late))) == pytest.approx(late, abs=5e-4)


def test_lag_of_a_first_order_system_on_a_ramp(control: Any) -> None:
    """1/(Ts + 1) follows a ramp T later."""
    time = np.arange(0.0, 5.0, 1e-3)
    _, y = control.forced_response(control.tf([1.0], [0.05, 1.0]), time, time)
    assert lag(time, time, y) == pytest.approx(0.05, abs=2e-3)


def test_tracking_figures() -> None:
    """A sine as error: rms is its amplitude over √2; samples need not be evenly spaced."""
    time = np.sort(np.random.default_rng(1).uniform(0.0, 1.0, 20000))
    time[[0, -1]] = 0.0, 1.0
    found = tracking_figures(time, np.sin(2.0 * np.pi * time), np.zeros_like(time))
    assert found.rms == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert found.peak == pytest.approx(1.0, rel=1e-3)
    assert np.isnan(tracking_figures(time, np.ones_like(time), np.zeros_like(time)).lag)


def test_time_saturated() -> None:
    time = np.arange(0.0, 1.0, 0.01)
    output = np.where((time > 0.2) & (time < 0.5), -100.0, 20.0)
    assert time_saturated(time, output, 100.0) == pytest.approx(0.29)
    assert time_saturated(time, output, np.nan) == 0.0


def chirped(control: Any, system: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, input and output of a sweep from 0.1 to 20 Hz in 60 s, at rest before and after."""
    time = np.arange(0.0, 66.0, 0.01)
    inside = np.clip(time - 1.0, 0.0, 60.0)
    ratio = np.log(200.0) / 60.0
    phase = 2.0 * np.pi * 0.1 * (np.exp(ratio * inside) - 1.0) / ratio
    reference = np.where((time > 1.0) & (time < 61.0), np.sin(phase), 0.0)
    _, y = control.forced_response(system, time, reference)
    return time, reference, y


@SYSTEM
def test_the_frequency_response_is_that_of_python_control(
    control: Any, system: tuple[list[float], list[float]]
) -> None:
    """Gain within 0.2 dB and phase within 3° from 0.2 to 8 Hz; bandwidth within 2 %."""
    made = control.tf(*system)
    time, reference, y = chirped(control, made)
    found = frequency_response(time, reference, y, 0.1, 20.0)
    known = control.frequency_response(made, 2.0 * np.pi * found.frequency)
    inside = (found.frequency > 0.2) & (found.frequency < 8.0)
    assert np.sum(inside) > 20
    error_db = 20.0 * np.log10(found.gain / known.magnitude)[inside]
    assert np.max(np.abs(error_db)) < 0.2
    assert np.max(np.abs(found.phase - np.degrees(known.phase))[inside]) < 3.0
    assert np.min(found.coherence[inside]) > 0.98
    known_bandwidth = control.bandwidth(made) / (2.0 * np.pi)
    assert bandwidth(found) == pytest.approx(known_bandwidth, rel=0.02)


def test_resonance(control: Any) -> None:
    """Of ζ = 0.15: −20 log(2 ζ √(1 − ζ²)) at ω √(1 − 2 ζ²)."""
    ringing = control.tf(*SYSTEMS["ringing"])
    height, frequency = resonance(frequency_response(*chirped(control, ringing), 0.1, 20.0))
    assert height == pytest.approx(-20.0 * np.log10(0.3 * np.sqrt(1.0 - 0.15**2)), abs=0.3)
    assert frequency == pytest.approx(10.0 * np.sqrt(1.0 - 2.0 * 0.15**2) / 6.283, rel=0.05)


def test_noise_lowers_the_coherence(control: Any) -> None:
    time, reference, y = chirped(control, control.tf(*SYSTEMS["usual"]))
    noise = np.random.default_rng(2).normal(0.0, 1.0, y.size)
    found = frequency_response(time, reference, y + noise, 0.1, 20.0)
    assert np.median(found.coherence) < 0.9
