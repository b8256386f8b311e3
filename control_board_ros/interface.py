# SPDX-License-Identifier: Apache-2.0
"""Every topic, service and action of a board, once: name, type, QoS and meaning.

The node offers these, the client uses them, and docs/interface.md is made from them; a test
compares them, and a running node, with a golden copy (test/support/interface_table.py). Types are
text until they are loaded, so that importing this module imports no ROS. What a service does
with a board is in operations.py, unless it reads what methods of the board return: then its row
here says so.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace
from typing import Any, Literal

from .core.terms.vocabs import CommandKind

K = CommandKind

#: Maximum number of joints of a board or robot.
MOST_JOINTS = 500

#: Name in the graph of a node whose endpoints were discovered before its name.
NOT_KNOWN_YET = "_NODE_NAME_UNKNOWN_"


@dataclass(frozen=True, slots=True, kw_only=True)
class QoS:
    """Quality of service: history keep last ``depth`` messages; durability volatile or latched.

    ``latched`` is DDS's transient local: a late subscriber receives the last message.
    """

    depth: int
    reliable: bool = True
    latched: bool = False

    def profile(self) -> Any:
        """A new rclpy QoSProfile, as rclpy writes ``qos_overrides`` into it; loads rclpy."""
        qos = importlib.import_module("rclpy.qos")
        reliability, durability = qos.ReliabilityPolicy, qos.DurabilityPolicy
        return qos.QoSProfile(
            depth=self.depth,
            reliability=reliability.RELIABLE if self.reliable else reliability.BEST_EFFORT,
            durability=durability.TRANSIENT_LOCAL if self.latched else durability.VOLATILE,
        )

    def __str__(self) -> str:
        reliability = "reliable" if self.reliable else "best effort"
        history = f"depth {self.depth}" if self.depth == 1 else f"keep last {self.depth}"
        return ", ".join([reliability, *["transient local"] * self.latched, history])


STREAM = QoS(depth=10)
LATCHED = QoS(depth=1, latched=True)
#: A late subscriber receives the last 50 messages.
HISTORY = QoS(depth=50, latched=True)
NEWEST = QoS(depth=1, reliable=False)
#: As tf2's own broadcaster has it; several boards share the topic.
TRANSFORMS = QoS(depth=100)
#: With rclpy's depth of 10, a hundred clients that call at once lose most of their answers.
REQUESTS = QoS(depth=1000)


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A topic, service or action of a board.

    Attributes:
        kind: the board publishes a topic and subscribes to a command.
        name: below the node's with ``~/``, absolute with ``/``, else below the node's namespace.
        type: full name of the interface, ``package/msg/Name``.
        qos: of the topic; of a service's requests and responses, and of an action's services.
        meaning: in sentences; of standard and of YARP's endpoints empty.
        reference: the kind of reference that a command sets, if any.
        reads: of a service that only reads joints: fields of its response, and the methods of the
            board (``JointGroup``) whose values they are, one for each joint.
    """

    kind: Literal["topic", "command", "service", "action"]
    name: str
    type: str
    qos: QoS
    meaning: str = ""
    reference: CommandKind | None = None
    reads: tuple[tuple[str, str], ...] = ()

    @property
    def short(self) -> str:
        """The name without the node's: ``set_control_mode``, ``command/position``."""
        return self.name.removeprefix("~").removeprefix("/")

    def of(self, board: str) -> str:
        """The name on ROS for a board of this full name: ``/icub/left_arm/modes``."""
        if self.name.startswith("~"):
            return board.rstrip("/") + self.name.removeprefix("~")
        if self.name.startswith("/"):
            return self.name
        namespace, slash, _ = board.rpartition("/")
        return f"{namespace}{slash}{self.name}"

    def load(self) -> Any:
        """The Python class of the type; the first call imports its package."""
        package, kind, name = self.type.split("/")
        return getattr(importlib.import_module(f"{package}.{kind}"), name)


def full(kind: str, type_: str, name: str = "") -> str:
    """The full name of a type; empty: that of the endpoint's name, ``GetBrake`` of ``get_brake``.

    One without a package is of control_board_msgs.
    """
    type_ = type_ or "".join(map(str.capitalize, name.rpartition("/")[2].split("_")))
    return type_ if "/" in type_ else f"control_board_msgs/{kind}/{type_}"


def topic(name: str, type_: str, qos: QoS, meaning: str = "") -> Endpoint:
    """A topic that the board publishes."""
    return Endpoint("topic", name, full("msg", type_), qos, meaning)


def command(
    name: str, meaning: str = "", reference: K | None = None, *, type_: str = ""
) -> Endpoint:
    """A topic that the board subscribes to; ``qos_overrides`` parameters change its QoS."""
    type_ = full("msg", type_, f"{name}_command")
    return Endpoint("command", name, type_, STREAM, meaning, reference)


def service(name: str, meaning: str = "", *, type_: str = "", **reads: str) -> Endpoint:
    """A service; ``reads``: methods of the board by the fields of the response."""
    type_, fields = full("srv", type_, name), tuple(reads.items())
    return Endpoint("service", name, type_, REQUESTS, meaning, reads=fields)


def action(name: str, meaning: str, *, type_: str = "") -> Endpoint:
    """An action: a goal, feedback, a result."""
    return Endpoint("action", name, full("action", type_, name), REQUESTS, meaning)


# -- published --------------------------------------------------------------------------------

JOINT_STATES = topic(
    "joint_states",
    "sensor_msgs/msg/JointState",
    STREAM,
    "Measured position, velocity and torque (NaN without a torque sensor) of every joint, "
    "`state_rate` times a second, stamped with the time of the reading.",
)
MODES = topic(
    "~/modes",
    "JointModes",
    LATCHED,
    "Modes of every joint, on every change, including one that lasts a single cycle.",
)
STATE = topic(
    "~/state",
    "BoardState",
    STREAM,
    "Readings and references of every joint, `state_rate` times a second on average, on whole "
    "control cycles; at most one per cycle.",
)
FAULTS = topic("~/faults", "JointFaults", LATCHED, "The joints in fault now, on every change.")
REQUEST_LOG = topic(
    "~/requests",
    "Request",
    HISTORY,
    "Each service call that changes something, but for `~/step`, and each goal of an action, with "
    "its answer, when it is answered.",
)
CONTROLLER_STATE = topic(
    "~/controller_state",
    "control_msgs/msg/JointTrajectoryControllerState",
    STREAM,
    "Reference, measurement and error of every joint, `state_rate` times a second, for the "
    "plotting tools of trajectory controllers.",
)
ROBOT_DESCRIPTION = topic("robot_description", "std_msgs/msg/String", LATCHED, "The URDF.")
DIAGNOSTICS = topic(
    "/diagnostics",
    "diagnostic_msgs/msg/DiagnosticArray",
    STREAM,
    "Once a second: loop rate, overruns, worst latency, rejected commands, faults; lost and late "
    "answers and dropped frames of drives; with `timing`, where the time of the cycles went. One "
    "entry for the board and one per joint, whose names begin with the board's full name.",
)
CLOCK = topic(
    "/clock",
    "rosgraph_msgs/msg/Clock",
    NEWEST,
    "The time of the stamps, where `publish_clock` or `use_sim_time` is set or "
    "`real_time_factor` is or has been other than 1. See [Time](#time).",
)
TF = topic(
    "/tf",
    "tf2_msgs/msg/TFMessage",
    TRANSFORMS,
    "The frame of each link on a joint that moves, mimic joints included, in that of the link "
    "before it, `state_rate` times a second, where `publish_tf` is set.",
)
TF_STATIC = topic(
    "/tf_static",
    "tf2_msgs/msg/TFMessage",
    LATCHED,
    "The frames of links on fixed joints, once, where `publish_tf` is set.",
)

# -- commands ---------------------------------------------------------------------------------

POSITION_COMMAND = command("~/command/position", "Moves along minimum-jerk profiles.", K.POSITION)
POSITION_DIRECT_COMMAND = command(
    "~/command/position_direct", "Position steps.", K.POSITION_DIRECT
)
VELOCITY_COMMAND = command(
    "~/command/velocity", "Velocities; they expire after `timeouts.velocity`.", K.VELOCITY
)
TORQUE_COMMAND = command("~/command/torque", "Torques.", K.TORQUE)
OUTPUT_COMMAND = command("~/command/output", "PWM in percent.", K.OUTPUT)
VELOCITY_DIRECT_COMMAND = command(
    "~/command/velocity_direct",
    "Velocities without a ramp; they expire after `timeouts.velocity`.",
    K.VELOCITY_DIRECT,
)
CURRENT_COMMAND = command("~/command/current", "Motor currents in A.", K.CURRENT)
FEEDFORWARD_COMMAND = command(
    "~/command/feedforward",
    "Terms added to the output, or to the impedance torque. Accepted in every mode.",
)
JOINT_TRAJECTORY = command(
    "~/joint_trajectory",
    "Points to follow, interpolated; see [Trajectories](#trajectories).",
    K.POSITION_DIRECT,
    type_="trajectory_msgs/msg/JointTrajectory",
)
JOINT_COMMANDS = command(
    "~/joint_commands",
    "References that the mode of each joint accepts: its position, velocity or effort, by its "
    "control mode; NaN is no command. See [Joint commands](#joint-commands).",
    type_="sensor_msgs/msg/JointState",
)
EXTERNAL_TORQUE = command(
    "~/external_torque",
    "Simulation only, with `allow_fault_injection`: external torques on the joints, N·m, until "
    "the next message.",
    type_="TorqueCommand",
)

EXTERNAL_TORQUE_SENSOR = command(
    "~/external_torque_sensor",
    "Joint torques that another program measures or computes, N·m, for joints whose "
    "`torque_sensor` is `external`; without them for `timeouts.torque_sensor` such a joint is in "
    "HW_FAULT where it needs them.",
    type_="JointTorques",
)
HEARTBEAT = Endpoint(
    "command",
    "~/heartbeat",
    "std_msgs/msg/Empty",
    NEWEST,
    "Sign of life of the board's supervisor; with `heartbeat_timeout` above 0 its silence is an "
    "emergency stop.",
)
GOAL_HEARTBEAT = Endpoint(
    "command",
    "~/goal_heartbeat",
    "unique_identifier_msgs/msg/UUID",
    QoS(depth=10, reliable=False),
    "Sign of life of the program behind a goal of `~/follow_joint_trajectory`: the goal's id. A "
    "goal that has had one ends, and its joints stop, when none comes for 2 s; others need none.",
)

# -- services ---------------------------------------------------------------------------------

SET_CONTROL_MODE = service("~/set_control_mode", "Set the control modes of joints.")
GET_CONTROL_MODE = service("~/get_control_mode", "Read the control modes of joints.")
SET_INTERACTION_MODE = service("~/set_interaction_mode", "Set the interaction modes of joints.")
GET_INTERACTION_MODE = service("~/get_interaction_mode", "Read the interaction modes of joints.")
GET_AVAILABLE_MODES = service(
    "~/get_available_modes", "Read the modes that each joint implements."
)
GET_LIMITS = service(
    "~/get_limits",
    "Read the limits in force of joints: those of the board, or of the drive where they are "
    "narrower.",
)
GET_DRIVES = service(
    "~/get_drives",
    "Read the set-points that the drives of joints accept, where each loop runs, and what drives "
    "report.",
)
SEND_REFERENCE = service(
    "~/send_reference",
    "Send references of one kind, as its command topic does, and answer for each joint: for "
    "single commands. Topics are for streams.",
)
SET_IMPEDANCE = service(
    "~/set_impedance", "Set the virtual spring and damper of joints, at any time."
)
GET_IMPEDANCE = service(
    "~/get_impedance", "Read the virtual spring and damper of joints, and their limits."
)
SET_REFERENCE_SPEED = service(
    "~/set_reference_speed",
    "Set the speeds of position moves and the accelerations of velocity ramps, for commands "
    "that give none.",
)
GET_REFERENCES = service(
    "~/get_references",
    "Read the last accepted reference of every kind.",
    positions="get_target_position",
    direct_positions="get_ref_position",
    velocities="get_target_velocity",
    torques="get_ref_torque",
    outputs="get_output",
    speeds="get_ref_speed",
    accelerations="get_ref_acceleration",
    direct_velocities="get_direct_velocity",
    currents="get_ref_current",
    ref_velocities="get_ref_velocity",
)
SET_BRAKE = service("~/set_brake", "Set the brake modes of joints.")
GET_BRAKE = service(
    "~/get_brake",
    "Read the brake modes of joints, and whether their brakes are closed.",
    modes="get_brake",
    closed="is_joint_braked",
)
GET_COUPLING = service(
    "~/get_coupling", "Read the coupling of the board's axes with the physical joints."
)
STOP = service(
    "~/stop", "Stop the motion of joints: they brake, and are held where they come to rest."
)
GET_FAULTS = service("~/get_faults", "Read the last fault of joints, also after it was cleared.")
RECOVER = service(
    "~/recover",
    "Clear the faults of joints and restore the modes before them, in one control cycle.",
)
GET_FREEZE_FRAME = service(
    "~/get_freeze_frame",
    "Read the readings and references around a joint's last fault, also after it was cleared: "
    "1.5 s before and 0.5 s after it, every control cycle.",
)
EMERGENCY_STOP = service(
    "~/emergency_stop",
    "`data: true` puts every joint of the robot into HW_FAULT, without power, in the next cycle; "
    "`data: false` releases it, and the joints stay in HW_FAULT until FORCE_IDLE or `~/recover`.",
    type_="std_srvs/srv/SetBool",
)
LIST_POSES = service(
    "~/list_poses", "Read the names of the poses, and the positions of one of them."
)
SAVE_POSE = service("~/save_pose", "Save or replace a pose in the user's own file.")
GET_MOTORS = service(
    "~/get_motors",
    "Read the state and the limits of the motors of joints and of their amplifiers.",
)
SET_MOTORS = service(
    "~/set_motors", "Set the limits of the amplifiers of joints, within the configured ones."
)
GET_PIDS = service("~/get_pids", "Read the state of one control loop of joints.")
SET_PIDS = service(
    "~/set_pids", "Reset one control loop of joints, or set the offset of its output."
)
SET_ENCODERS = service(
    "~/set_encoders", "Set the readings of the encoders of joints at their present positions."
)
CONFIGURE = service(
    "~/configure",
    "The configuration is complete: joints leave NOT_CONFIGURED. Needed only with "
    "`autoconfigure: false`.",
    type_="std_srvs/srv/Trigger",
)
POWER_CYCLE = service("~/power_cycle", "Back to power-on.", type_="std_srvs/srv/Trigger")
INJECT_FAULT = service(
    "~/inject_fault", "Inject a fault into simulated joints, for the board to detect."
)
CLEAR_INJECTED_FAULTS = service(
    "~/clear_injected_faults",
    "Simulation only: remove injected causes. The joints stay in HW_FAULT until FORCE_IDLE.",
    type_="std_srvs/srv/Trigger",
)
PAUSE = service(
    "~/pause",
    "Simulation only: `data: true` stops simulated time, `data: false` resumes it.",
    type_="std_srvs/srv/SetBool",
)
STEP = service("~/step", "Advance a paused simulation.")
RESET = service(
    "~/reset",
    "Simulation only: back to the initial pose and power-on, without external torques and "
    "injected faults.",
    type_="std_srvs/srv/Trigger",
)

# -- actions ----------------------------------------------------------------------------------

CALIBRATE = action("~/calibrate", "Calibrate joints.")
MOVE = action("~/move", "Move joints along minimum-jerk profiles and wait for the end.")
GO_TO_POSE = action(
    "~/go_to_pose",
    "Move joints to a named pose, all of them arriving together, and wait for the end.",
)
FOLLOW_JOINT_TRAJECTORY = action(
    "~/follow_joint_trajectory",
    "Follow a trajectory to its end within tolerances, as requested by MoveIt; see "
    "[Trajectories](#trajectories).",
    type_="control_msgs/action/FollowJointTrajectory",
)

#: Additional services of a managed node (``lifecycle``), by rclpy's own means.
LIFECYCLE = (
    service("~/change_state", type_="lifecycle_msgs/srv/ChangeState"),
    service("~/get_state", type_="lifecycle_msgs/srv/GetState"),
    service("~/get_available_states", type_="lifecycle_msgs/srv/GetAvailableStates"),
    service("~/get_available_transitions", type_="lifecycle_msgs/srv/GetAvailableTransitions"),
    service("~/get_transition_graph", type_="lifecycle_msgs/srv/GetAvailableTransitions"),
    topic("~/transition_event", "lifecycle_msgs/msg/TransitionEvent", STREAM),
)

# -- for clients of YARP ------------------------------------------------------------------------

#: Offered with ``yarp_interface``; here ``~`` is ``yarp_msgs_name`` (docs/howto/yarp_clients.md).
YARP: tuple[Endpoint, ...] = (
    topic("joint_states/controlModes", "std_msgs/msg/Int8MultiArray", STREAM),
    topic("joint_states/controlModeVocabs", "std_msgs/msg/Int32MultiArray", STREAM),
    command("~/position", type_="yarp_control_msgs/msg/Position", reference=K.POSITION),
    command(
        "~/position_direct",
        type_="yarp_control_msgs/msg/PositionDirect",
        reference=K.POSITION_DIRECT,
    ),
    command("~/velocity", type_="yarp_control_msgs/msg/Velocity", reference=K.VELOCITY),
    service("~/get_modes", type_="yarp_control_msgs/srv/GetControlModes"),
    service("~/set_modes", type_="yarp_control_msgs/srv/SetControlModes"),
    service("~/get_position", type_="yarp_control_msgs/srv/GetPosition"),
    service("~/get_velocity", type_="yarp_control_msgs/srv/GetVelocity"),
    service("~/get_available_modes", type_="yarp_control_msgs/srv/GetAvailableControlModes"),
    service("~/get_joints_names", type_="yarp_control_msgs/srv/GetJointsNames"),
)

#: A part of a robot has its readings below its own name; the robot's are in its namespace.
PART_JOINT_STATES = replace(JOINT_STATES, name="~/joint_states")

#: All of the above that every board has, in this order.
ENDPOINTS: tuple[Endpoint, ...] = tuple(
    value
    for value in list(globals().values())
    if isinstance(value, Endpoint) and value is not PART_JOINT_STATES
)
#: Notes of an operator about a board: no board's topic; any node may publish it, and recorders
#: receive it.
NOTES = topic("~/notes", "std_msgs/msg/String", QoS(depth=100), "Notes of an operator.")
PUBLISHED = tuple(e for e in ENDPOINTS if e.kind == "topic")
COMMAND_TOPICS = tuple(e for e in ENDPOINTS if e.kind == "command")
SERVICES = tuple(e for e in ENDPOINTS if e.kind == "service")
ACTIONS = tuple(e for e in ENDPOINTS if e.kind == "action")
