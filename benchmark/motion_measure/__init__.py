# SPDX-License-Identifier: Apache-2.0
"""The measure of motion: how well each joint of a robot moves, on simulated time.

    rig = Rig.load("iiwa")
    findings = measure(rig, rows=("step", "sine"), poses=("home",), joints=None)

Everything here is deterministic: the board and its plant run in one process, time passes only
in control cycles, and poses come from fixed seeds. The same commit gives the same figures on
every machine, however busy.
"""
