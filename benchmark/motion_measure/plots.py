# SPDX-License-Identifier: Apache-2.0
"""The pictures of docs/motion.md."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from .force_rows import comply
from .position_rows import step_size
from .rig import M, Rig, Way
from .robots import ROBOTS
from .rows import ROWS

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
SHOWN = ("iiwa", "panda", "icub_left_arm", "kuka", "xarm6", "gantry")
FOLLOWED = ("iiwa", "panda", "xarm6")
SMALL = {"fontsize": 8}


def draw(now: Mapping[str, Any], before: Mapping[str, Any]) -> None:
    """Draw all of them into docs/images."""
    _reach(now, before)
    _step()
    _follow()
    _push()


def _save(figure: Any, name: str) -> None:
    figure.savefig(IMAGES / f"motion_{name}.png", dpi=110, metadata={"Software": None})
    plt.close(figure)


def _reach(now: Mapping[str, Any], before: Mapping[str, Any]) -> None:
    """Every figure over its goal, one dot per robot, before (hollow) and now."""
    lines = [(r, q) for r in ROWS.values() for q in r.quantities if q.shipped]
    robots = [name for name in ROBOTS if name in now]
    figure, axes = plt.subplots(figsize=(10, 8), constrained_layout=True)
    colours = [mpl.colormaps["tab20"](n) for n in range(len(robots))]
    for n, name in enumerate(robots):
        for record, style in ((before.get(name), "none"), (now[name], colours[n])):
            if not record:
                continue
            places, values = [], []
            for y, (row, quantity) in enumerate(lines):
                if found := record["figures"].get(f"{row.key}.{quantity.key}"):
                    goal = quantity.reach(record["derived"])
                    places.append(y + 0.09 * (n - 0.5 * len(robots)))
                    values.append(max(abs(found[0]) / goal, 1e-3))
            label = name if record is now[name] else None
            axes.scatter(
                values, places, s=22, facecolor=style, edgecolor=colours[n], label=label, zorder=3
            )
    axes.axvline(1.0, color="k", linewidth=1.0)
    axes.set_xscale("log")
    axes.set_yticks(range(len(lines)), [q.text for _, q in lines], fontsize=8)
    axes.invert_yaxis()
    axes.grid(axis="x", alpha=0.3)
    axes.set_xlabel("worst joint over what is to be reached (left of 1: reached); hollow: before")
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    _save(figure, "reach")


def _step() -> None:
    figure, grid = plt.subplots(2, 3, figsize=(11, 6), sharey=True, constrained_layout=True)
    for axes, name in zip(grid.flat, SHOWN, strict=True):
        rig = Rig.load(ROBOTS[name])
        for j, joint in enumerate(rig.joints):
            size = step_size(rig, j)
            way = 1.0 if rig.home[j] + 1.5 * size < rig.windows[j].upper else -1.0
            rig.go()
            rig.enter(j, M.POSITION_DIRECT, Way.STIFF)
            rig.run(0.2)
            start = rig.position(j)
            rig.expect(rig.board.set_position(j, start + way * size))
            record = rig.record(j, 0.6)
            axes.plot(
                record.time, way * (record.position - start) / size, linewidth=1, label=joint.name
            )
        rig.close()
        allowed = 1.15 if rig.derived else 1.05
        axes.axhspan(1.0, allowed, color="0.9", zorder=0)
        axes.set_title(f"{name} ({'derived' if rig.derived else 'shipped'})", **SMALL)
        axes.legend(fontsize=5, loc="lower right")
        axes.grid(alpha=0.3)
    for axes in grid[:, 0]:
        axes.set_ylabel("of the step", **SMALL)
    for axes in grid[1]:
        axes.set_xlabel("s", **SMALL)
    figure.suptitle("Direct step of 50 mrad from home; grey: allowed overshoot", **SMALL)
    _save(figure, "step")


def _follow() -> None:
    """A sine by direct positions, a move at top speed and a velocity step, with their errors."""
    figure, grid = plt.subplots(3, 3, figsize=(11, 8), constrained_layout=True)
    for row, name in zip(grid, FOLLOWED, strict=True):
        rig, j = Rig.load(ROBOTS[name]), 1
        limits = rig.joints[j].limits
        amplitude = min(0.5 * limits.velocity / math.tau, 0.5 * limits.acceleration / math.tau**2)
        rig.go()
        rig.enter(j, M.POSITION_DIRECT, Way.STIFF)
        centre = rig.position(j)

        def send(
            time: float, rig: Rig = rig, centre: float = centre, a: float = amplitude
        ) -> None:
            rig.board.set_position(1, centre + a * math.sin(math.tau * time))

        record = rig.record(j, 2.0, each=send)
        sent = centre + amplitude * np.sin(math.tau * record.time)
        _pair(row[0], record.time, sent, record.position, f"{name}: 1 Hz sine at 1 kHz")
        rig.go()
        target = rig.windows[j].clip(rig.position(j) + 0.5, 0.1)
        rig.expect(rig.board.position_move(j, target, limits.velocity))
        record = rig.record(j, float(rig.board.get_remaining_time(j)[0]) + 0.3)
        title = f"{name}: move of 0.5 rad at top speed"
        _pair(row[1], record.time, record.reference, record.position, title)
        rig.go()
        rig.enter(j, M.VELOCITY, Way.STIFF)
        rig.expect(rig.board.velocity_move(j, 0.5 * limits.velocity, limits.acceleration))
        record = rig.record(j, 0.6)  # the reference expires after 0.2 s
        speed = 0.5 * limits.velocity
        row[2].plot(record.time, record.velocity / speed, linewidth=1)
        row[2].plot(record.time, np.gradient(record.reference, rig.period) / speed, "k--", lw=0.7)
        row[2].set_title(f"{name}: half the limit speed for 0.2 s, then none", **SMALL)
        row[2].grid(alpha=0.3)
        rig.close()
    for axes in grid[-1]:
        axes.set_xlabel("s", **SMALL)
    _save(figure, "follow")


def _pair(axes: Axes, time: Any, wanted: Any, found: Any, title: str) -> None:
    axes.plot(time, found - wanted[0], linewidth=1.2, color="C0", label="measured")
    axes.plot(time, wanted - wanted[0], "k--", linewidth=0.8, label="sent")
    axes.set_title(title, **SMALL)
    axes.set_ylabel("rad", **SMALL)
    axes.grid(alpha=0.3)
    other = axes.twinx()
    other.plot(time, 1e3 * (found - wanted), linewidth=0.8, color="C3")
    other.set_ylabel("error, mrad", color="C3", **SMALL)


def _push() -> None:
    """Released from a push at the greatest stiffness; pushed while STIFF."""
    figure, grid = plt.subplots(2, 3, figsize=(11, 6), constrained_layout=True)
    for column, name in enumerate(FOLLOWED):
        rig = Rig.load(ROBOTS[name])
        for j, joint in enumerate(rig.joints):
            if not rig.has(j, M.POSITION, Way.COMPLIANT):
                continue
            rig.go()
            comply(rig, j, joint.impedance.max_stiffness)
            rig.rest(j)
            rig.simulation.plant.push(j, 0.2 * joint.limits.torque)
            rig.rest(j)
            start = rig.position(j)
            rig.simulation.plant.push(j, 0.0)
            record = rig.record(j, 0.8)
            part = (record.position - record.position[-1]) / (start - record.position[-1])
            grid[0, column].plot(record.time, part, linewidth=1, label=joint.name)
            rig.go()
            start = rig.position(j)
            rig.simulation.plant.push(j, 0.5 * joint.limits.torque)
            record = rig.record(j, 0.5)
            rig.simulation.plant.push(j, 0.0)
            grid[1, column].plot(record.time, 1e3 * (record.position - start), linewidth=1)
        rig.close()
        grid[0, column].set_title(f"{name}: released at the greatest stiffness", **SMALL)
        grid[1, column].set_title(f"{name}: pushed by half the torque limit, STIFF", **SMALL)
        grid[0, column].legend(fontsize=5)
        for axes in grid[:, column]:
            axes.grid(alpha=0.3)
            axes.set_xlabel("s", **SMALL)
    grid[0, 0].set_ylabel("of the displacement", **SMALL)
    grid[1, 0].set_ylabel("mrad", **SMALL)
    _save(figure, "push")
