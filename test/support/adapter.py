# SPDX-License-Identifier: Apache-2.0
"""One face for the board in process and for the board over ROS.

Whatever SPEC A names (set_control_mode, position_move, get_encoder, …) goes straight to the
board or to the client; besides, an adapter lets time pass and breaks things:

    run(seconds)        simulated time passes
    rejected(joints)    how many commands were ignored (M4)
    power(joints)       the output in percent, as the motors get it
    restart()           power-on anew, from the home pose
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from rig import Rig

from control_board_ros.core.selection import Selector
from control_board_ros.core.terms.measurement import Array
from control_board_ros.settings import loading as settings
from control_board_ros.sim.plant import SimulatedPlant

CONFIG = Path(__file__).with_name("arm.yaml")
NAMES = ("left", "right", "bare")


@cache
def load() -> settings.Settings:
    """The configuration that both sides run."""
    return settings.load(CONFIG)


class InProcess:
    """The board in this process, on the ideal plant."""

    def __init__(self, **overrides: Any) -> None:
        made = settings.load(CONFIG, overrides) if overrides else load()
        self._plant = SimulatedPlant(made.board, replace(made.simulation, urdf=None))
        self._rig = Rig(made.board, self._plant)
        self._rig.tick()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._rig.board, name)

    def run(self, seconds: float) -> None:
        self._rig.run(seconds)

    def rejected(self, joints: Any = None) -> list[int]:
        chosen = Selector(NAMES).select(joints).joints
        return [int(count) for count in self._rig.board.snapshot().rejected_commands[chosen]]

    def power(self, joints: Any = None) -> Array:
        return self._rig.board.snapshot().output[Selector(NAMES).select(joints).joints]

    def reference(self, joints: Any = None) -> Array:
        """The position references in force."""
        snapshot = self._rig.board.snapshot()
        return snapshot.position_reference[Selector(NAMES).select(joints).joints]

    def inject_fault(self, joints: Any, fault: str, persistent: bool = False) -> None:
        for j in Selector(NAMES).select(joints).joints:
            self._plant.inject(int(j), fault, persistent)

    def clear_injected_faults(self) -> None:
        self._plant.clear_injected()


#: What the client reads from the state that the board publishes.
#: What goes to a topic, and is answered where that is requested.
STREAMS = ("set_position", "velocity_move", "set_ref_torque", "set_output", "set_feedforward")
MEASURED = ("get_encoder", "get_encoder_speed", "get_torque", "check_motion_done", "get_state")

#: Cycles after which a published state shows what was requested before.
SETTLED = 3


class OverRos:
    """A ControlBoardClient, and a paused simulation that goes on step by step."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._period = load().board.period
        self._counted = np.zeros(len(NAMES), dtype=int)
        self._ahead = 0
        self._time = 0.0  # of the last reading; simulated, as the states are stamped

    def start(self) -> None:
        """Pause, and learn what time it is: that of a fault, which the board tells at once."""
        assert self._client.pause(True)
        assert not self._client.set_control_mode("bare", "veld")
        self._time = self._client.get_faults("bare")[0].stamp

    def restart(self) -> None:
        """Back to the initial pose and power-on, and configured."""
        for reply in (self._client.clear_injected_faults(), self._client.reset()):
            assert reply, reply.message
        self._ahead = 0
        self._counted[:] = 0
        self._counted += self.rejected()

    def __getattr__(self, name: str) -> Any:
        if name in MEASURED:
            # A paused board publishes no states. The next run is the shorter.
            self._step(SETTLED)
            self._ahead += SETTLED
            shown = self._time - 0.5 * self._period
            self._client.wait_for_state(lambda state: state.stamp > shown)
        method = getattr(self._client, name)
        return partial(method, answered=True) if name in STREAMS else method

    def run(self, seconds: float) -> None:
        cycles = round(seconds / self._period)
        self._step(max(1, cycles - self._ahead))
        self._ahead = max(0, self._ahead - cycles)

    def calibrate(self, joints: Any = None) -> Any:
        """Only start it, as in process: time goes on by steps."""
        return self._client.calibrate(joints, wait=False)

    def _step(self, cycles: int) -> None:
        reply = self._client.step(cycles)
        assert reply, reply.message
        self._time += cycles * self._period

    def _show(self, field: str, joints: Any) -> Any:
        values: Sequence[Any] = getattr(self.get_state(), field)
        return np.asarray(values)[Selector(NAMES).select(joints).joints]

    def rejected(self, joints: Any = None) -> list[int]:
        """Counted from the last restart."""
        counts = np.asarray(self._show("rejected_commands", None)).astype(int) - self._counted
        return [int(count) for count in counts[Selector(NAMES).select(joints).joints]]

    def power(self, joints: Any = None) -> Array:
        return np.array(self._show("output", joints))

    def reference(self, joints: Any = None) -> Array:
        """The position references in force."""
        return np.array(self._show("position_reference", joints))
