# SPDX-License-Identifier: Apache-2.0
"""A robot as a specification of MuJoCo: bodies, joints, and shapes on request.

Link for link the description that pybullet loads. Differences:

* the rotor of inertia J behind a gear of ratio N is an armature: J N² on its own joint only
  (pybullet gets it as part of the link's tensor, see ``description.rotor``);
* a follower is driven, without feedback to its leader: see ``FOLLOWER_ARMATURE``;
* MuJoCo's hard stops are springs and dampers: here with its solver's maximum stiffness, damped to
  match pybullet's.

MuJoCo's own reader loads only the first object of a Wavefront OBJ file; ours, all as one mesh.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ...core.model.coupling import Gear
from ...core.terms.measurement import Array
from ...description.geometry import axis_of, numbers_of, origin_of, principal_axes
from ...description.merge import NOTHING, inertial_of
from ...description.urdf_tree import Tree
from ..config import SimulationConfig
from ..errors import PlantError
from .prepare import FittedRobot


def read_obj(path: Path) -> tuple[Array, NDArray[np.int32]]:
    """Vertices, shape (v, 3), and triangles, shape (t, 3): indices of vertices.

    A face with more corners becomes a fan of triangles. Indices count from 1, negative ones from
    the last vertex before the face.

    Raises:
        ValueError: the file has no face, or refers to an unknown vertex.
    """
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for line in path.read_text(errors="replace").splitlines():
        key, *words = line.split() or [""]
        if key == "v":
            vertices.append([float(word) for word in words[:3]])
        elif key == "f":
            corners = [int(word.partition("/")[0]) for word in words]
            corners = [k - 1 if k > 0 else len(vertices) + k for k in corners]
            triangles += [(corners[0], *pair) for pair in pairwise(corners[1:])]
    faces = np.array(triangles, dtype=np.int32).reshape(-1, 3)
    if faces.size == 0 or faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError(f"{path}: no triangles of its own vertices; export the mesh again")
    return np.array(vertices, dtype=np.float64), faces


#: kg·m² or kg on each follower: the force A·a then accelerates the joint by a despite other loads,
#: and the supporting links feel its motion. Rounding error: 1e-10.
FOLLOWER_ARMATURE = 1e6
#: Time constant of stops and contacts in physics steps, the minimum of MuJoCo. One step removes
#: the speed into the stop.
STIFFEST = 2.0
#: Their damping ratio: a step removes 0.25/ζ² = 0.2 of the penetration, as in pybullet.
DAMPING_RATIO = 1.25**0.5
#: MuJoCo's maximum impedance: a stop yields by 1e-4 of the load.
HARDEST = 0.9999
#: Moment, kg·m², while the model is compiled; replaced afterwards.
HARMLESS = 1e-3
GREY = (0.75, 0.75, 0.78, 1.0)
#: File types supported by MuJoCo; shapes of others are omitted.
MESHES = (".obj", ".stl")
#: Prefix of link names: MuJoCo reserves "world".
LINK = "link "
GEAR = "gear of "
UNSCALED = (1.0, 1.0, 1.0)


class Builder:
    """Builds the specification of a fitted robot.

    Args:
        fitted: The robot.
        simulation: Gravity, physics step, whether the base is fixed.
        shapes: ``collision``, ``visual``, or empty for masses and joints alone.

    Attributes:
        spec: The specification; can be extended before compilation.
    """

    def __init__(self, fitted: FittedRobot, simulation: SimulationConfig, shapes: str) -> None:
        self._tree, self._shapes, self._rotors = fitted.tree, shapes, fitted.rotors
        self._stops = {stop.name: stop for stop in fitted.joints}
        self._solref = [STIFFEST * simulation.physics_step, DAMPING_RATIO]
        self._colours = _colours(fitted.tree.root)
        self._meshes: dict[str, str] = {}
        self._moments: dict[str, Array] = {}
        self.spec = mujoco.MjSpec()
        self.spec.compiler.degree = False
        self.spec.option.timestep = simulation.physics_step
        self.spec.option.gravity = simulation.gravity
        self.spec.option.disableflags = int(
            mujoco.mjtDisableBit.mjDSBL_AUTORESET | mujoco.mjtDisableBit.mjDSBL_EULERDAMP
        )
        if shapes != "collision":
            self.spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        base = self._add_link(self.spec.worldbody, self._tree.base, np.zeros(3), np.eye(3))
        if not simulation.base_fixed:
            base.add_freejoint()
        self._add_beyond(base, self._tree)
        for gear in fitted.gears:
            self._add_gear(gear)

    def build(self) -> Any:
        """Compile the model; raises PlantError, one line with MuJoCo's message, where MuJoCo
        rejects it.
        """
        try:
            model = self.spec.compile()
        except ValueError as error:
            reason = " ".join(str(error).split())[:300]
            raise PlantError(
                f"urdf: MuJoCo cannot load it ({reason}); check the robot's URDF"
            ) from None
        for name, moments in self._moments.items():
            model.body_inertia[model.body(name).id] = moments
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return model

    def attach(self, prefix: str, other: Builder) -> None:
        """Add another robot at the same place, its names after a prefix."""
        self.spec.attach(other.spec, prefix=prefix, frame=self.spec.worldbody.add_frame())
        self._moments |= {prefix + name: moments for name, moments in other._moments.items()}

    def add_box(self, centre: tuple[float, ...], half_extents: tuple[float, ...]) -> None:
        """Add a fixed box, m, that collides with the robot."""
        self._add_geom(
            self.spec.worldbody,
            "collision",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=centre,
            size=half_extents,
            contype=2,
            conaffinity=1,
            rgba=GREY,
        )

    def _add_gear(self, gear: Gear) -> None:
        """Let a joint be moved along with another; one felt by the other as it is."""
        place, ratio = gear.place(0.0)
        self.spec.add_equality(
            name=GEAR + gear.follower,
            type=mujoco.mjtEq.mjEQ_JOINT,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            name1=gear.follower,
            name2=gear.leader,
            data=[place, ratio, *[0.0] * (mujoco.mjNEQDATA - 2)],
            solref=[self._solref[0], 1.0],
            solimp=[HARDEST, HARDEST, 1e-3, 0.5, 2.0],
        )

    def _add_beyond(self, base: Any, tree: Tree) -> None:
        """Add every joint and its child link, from the base outwards."""
        bodies = {tree.base: base}
        for joint in tree.walk(tree.base):
            child = tree.child(joint)
            position, rotation = origin_of(joint)
            body = self._add_link(bodies[tree.parent(joint)], child, position, rotation)
            self._add_joint(body, joint)
            bodies[child] = body

    def _add_link(self, parent: Any, name: str, position: Array, rotation: Array) -> Any:
        link = self._tree.links[name]
        inertial = inertial_of(link) or NOTHING
        moments, axes = principal_axes(inertial.tensor)
        self._moments[LINK + name] = np.maximum(moments, 0.0)
        body = parent.add_body(
            name=LINK + name,
            pos=position,
            quat=quaternion(rotation),
            mass=max(inertial.mass, 1e-12),
            ipos=inertial.centre,
            iquat=quaternion(axes),
            inertia=[HARMLESS] * 3,
            explicitinertial=True,
        )
        for shape in link.findall(self._shapes or "nothing"):
            self._add_shape(body, shape)
        return body

    def _add_joint(self, body: Any, joint: ET.Element) -> None:
        name, slides = joint.get("name", ""), Tree.slides(joint)
        made = body.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
            axis=axis_of(joint),
            armature=self._rotors.get(name, FOLLOWER_ARMATURE),
        )
        made.limited = mujoco.mjtLimited.mjLIMITED_FALSE
        stop = self._stops.get(name)
        if stop is not None and math.isfinite(stop.upper - stop.lower):
            made.limited = mujoco.mjtLimited.mjLIMITED_TRUE
            made.range = [stop.lower, stop.upper]
            made.solref_limit = self._solref
            made.solimp_limit = [HARDEST, HARDEST, 1e-3, 0.5, 2.0]

    def _add_shape(self, body: Any, shape: ET.Element) -> None:
        """Add a <visual> or <collision>; omitted if MuJoCo cannot read it."""
        position, rotation = origin_of(shape)
        geometry = self._geometry(shape)
        if geometry is not None:
            placed = {"pos": position, "quat": quaternion(rotation)}
            self._add_geom(body, shape.tag, rgba=self._colour(shape), **placed, **geometry)

    def _geometry(self, shape: ET.Element) -> dict[str, Any] | None:
        kinds = mujoco.mjtGeom
        for element in shape.findall("geometry/*"):
            size = {key: numbers_of(element, key, (0.0,)) for key in ("radius", "length", "size")}
            radius, half = float(size["radius"][0]), 0.5 * float(size["length"][0])
            match element.tag:
                case "box":
                    return {"type": kinds.mjGEOM_BOX, "size": 0.5 * size["size"]}
                case "sphere":
                    return {"type": kinds.mjGEOM_SPHERE, "size": [radius, 0.0, 0.0]}
                case "cylinder":
                    return {"type": kinds.mjGEOM_CYLINDER, "size": [radius, half, 0.0]}
                case "capsule":
                    return {"type": kinds.mjGEOM_CAPSULE, "size": [radius, half, 0.0]}
                case "mesh" if Path(element.get("filename", "")).suffix.lower() in MESHES:
                    return {"type": kinds.mjGEOM_MESH, "meshname": self._mesh(element)}
        return None

    def _mesh(self, element: ET.Element) -> str:
        """The name of a mesh, loaded once per file and scale.

        Raises:
            PlantError: the file cannot be read.
        """
        path, scale = Path(element.get("filename", "")), numbers_of(element, "scale", UNSCALED)
        key = f"{path} {scale.tolist()}"
        if key not in self._meshes:
            self._meshes[key] = f"mesh_{len(self._meshes)}"
            mesh = self.spec.add_mesh(name=self._meshes[key], scale=scale)
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # of open ones, too
            if path.suffix.lower() == ".obj":
                try:
                    vertices, triangles = read_obj(path)
                except (OSError, ValueError) as error:
                    raise PlantError(f"urdf: a mesh cannot be read: {error}") from None
                mesh.uservert, mesh.userface = vertices.ravel(), triangles.ravel()
            else:
                mesh.file = str(path)
        return self._meshes[key]

    def _add_geom(self, body: Any, use: str, **values: Any) -> None:
        touches = {"contype": 1, "conaffinity": 2} if use == "collision" else {}
        attributes = {"contype": 0, "conaffinity": 0, "solref": self._solref} | touches | values
        geom = body.add_geom(**attributes)
        geom.condim = 3

    def _colour(self, shape: ET.Element) -> tuple[float, ...]:
        material = shape.find("material")
        if material is None:
            return GREY
        rgba = numbers_of(material.find("color"), "rgba", ())
        return tuple(rgba) if rgba.size == 4 else self._colours.get(material.get("name", ""), GREY)


def quaternion(rotation: Array) -> Array:
    """Unit quaternion w, x, y, z, shape (4,), of a rotation matrix."""
    turn = np.zeros(4)
    mujoco.mju_mat2Quat(turn, rotation.ravel())
    return turn


def _colours(root: ET.Element) -> dict[str, tuple[float, ...]]:
    """Colours of the description by name: RGBA from 0 to 1."""
    colours = {}
    for material in root.iter("material"):
        colour = numbers_of(material.find("color"), "rgba", ())
        if colour.size == 4:
            colours[material.get("name", "")] = tuple(colour.tolist())
    return colours
