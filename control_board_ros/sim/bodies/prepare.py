# SPDX-License-Identifier: Apache-2.0
"""A robot description made ready for one board: what is driven, what follows, what is fixed."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

from ...core.config import BoardConfig, ConfigError
from ...description.rotor import Moments, normalise_axis, with_rotor_inertia
from ...description.urdf import load
from ..config import Mimic, SimulationConfig
from ..motor import reflected_inertia


@dataclass(frozen=True, slots=True)
class Model:
    """What the physics loads.

    Attributes: text (URDF), mimics (joints that follow a joint of the board), moments (inertia
    to set afterwards, by link, kg·m²; see ``rotor``).
    """

    text: str
    mimics: tuple[Mimic, ...]
    moments: Moments


def prepare(board: BoardConfig, simulation: SimulationConfig) -> Model:
    """Fit the robot description of a simulation to its board.

    Joints that neither the board drives nor follow one that it drives become fixed. Followers
    are those of the configuration and the <mimic> elements of the description; a joint that
    the board drives itself follows none.

    Raises:
        ConfigError: the description lacks a joint of the board.
        UrdfError: the description cannot be read.
    """
    source = simulation.urdf or ""
    text = source if source.lstrip().startswith("<") else load(Path(source)).text
    root = ET.fromstring(text)
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    for name in board.names:
        if name not in joints or joints[name].get("type") == "fixed":
            moving = [key for key, joint in joints.items() if joint.get("type") != "fixed"]
            raise ConfigError("joints", name, f"a joint of the URDF: {', '.join(moving)}")
    mimics = {mimic.joint: mimic for mimic in simulation.mimics if mimic.joint in joints}
    for name, joint in joints.items():
        normalise_axis(joint)
        if name in board.names or name in mimics:
            continue
        if (follower := _follower(name, joint, board.names)) is not None:
            mimics[name] = follower
        else:
            joint.set("type", "fixed")
    rotors = dict(zip(board.names, reflected_inertia(board, simulation).tolist(), strict=True))
    text, moments = with_rotor_inertia(ET.tostring(root, encoding="unicode"), rotors)
    return Model(text, tuple(mimics.values()), moments)


def _follower(name: str, joint: ET.Element, sources: tuple[str, ...]) -> Mimic | None:
    mimic = joint.find("mimic")
    if mimic is None or mimic.get("joint") not in sources:
        return None
    return Mimic(
        joint=name,
        source=mimic.get("joint", ""),
        multiplier=float(mimic.get("multiplier", "1")),
        offset=float(mimic.get("offset", "0")),
    )
