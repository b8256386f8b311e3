# SPDX-License-Identifier: Apache-2.0
"""The ROS interface as promised, in one place; a test compares a running node with it.

Names starting with ``~`` are below the node's, others below its namespace. QoS: R reliable, B
best effort; V volatile, T transient local.
"""

PUBLISHED = {
    "joint_states": ("sensor_msgs/msg/JointState", "RV"),
    "~/modes": ("control_board_msgs/msg/JointModes", "RT"),
    "~/state": ("control_board_msgs/msg/BoardState", "RV"),
    "~/faults": ("control_board_msgs/msg/JointFaults", "RT"),
    "~/requests": ("control_board_msgs/msg/Request", "RT"),
    "~/controller_state": ("control_msgs/msg/JointTrajectoryControllerState", "RV"),
    "robot_description": ("std_msgs/msg/String", "RT"),
    "/diagnostics": ("diagnostic_msgs/msg/DiagnosticArray", "RV"),
}
#: Only with publish_clock, or where simulated and real time differ.
CLOCK = {"/clock": ("rosgraph_msgs/msg/Clock", "BV")}
#: Only with publish_tf.
TF = {
    "/tf": ("tf2_msgs/msg/TFMessage", "RV"),
    "/tf_static": ("tf2_msgs/msg/TFMessage", "RT"),
}
#: What every ROS node publishes.
OF_EVERY_NODE = {"/rosout", "/parameter_events"}

SUBSCRIBED = {
    "~/command/position": ("control_board_msgs/msg/PositionCommand", "RV"),
    "~/command/position_direct": ("control_board_msgs/msg/PositionDirectCommand", "RV"),
    "~/command/velocity": ("control_board_msgs/msg/VelocityCommand", "RV"),
    "~/command/torque": ("control_board_msgs/msg/TorqueCommand", "RV"),
    "~/command/output": ("control_board_msgs/msg/OutputCommand", "RV"),
    "~/command/velocity_direct": ("control_board_msgs/msg/VelocityDirectCommand", "RV"),
    "~/command/current": ("control_board_msgs/msg/CurrentCommand", "RV"),
    "~/command/feedforward": ("control_board_msgs/msg/FeedforwardCommand", "RV"),
    "~/joint_trajectory": ("trajectory_msgs/msg/JointTrajectory", "RV"),
    "~/joint_commands": ("sensor_msgs/msg/JointState", "RV"),
    "~/external_torque": ("control_board_msgs/msg/TorqueCommand", "RV"),
    "~/external_torque_sensor": ("control_board_msgs/msg/JointTorques", "RV"),
    "~/heartbeat": ("std_msgs/msg/Empty", "BV"),
}

SERVICES = {
    "~/set_control_mode": "control_board_msgs/srv/SetControlMode",
    "~/get_control_mode": "control_board_msgs/srv/GetControlMode",
    "~/set_interaction_mode": "control_board_msgs/srv/SetInteractionMode",
    "~/get_interaction_mode": "control_board_msgs/srv/GetInteractionMode",
    "~/get_available_modes": "control_board_msgs/srv/GetAvailableModes",
    "~/get_limits": "control_board_msgs/srv/GetLimits",
    "~/get_drives": "control_board_msgs/srv/GetDrives",
    "~/send_reference": "control_board_msgs/srv/SendReference",
    "~/set_impedance": "control_board_msgs/srv/SetImpedance",
    "~/get_impedance": "control_board_msgs/srv/GetImpedance",
    "~/set_reference_speed": "control_board_msgs/srv/SetReferenceSpeed",
    "~/get_references": "control_board_msgs/srv/GetReferences",
    "~/set_brake": "control_board_msgs/srv/SetBrake",
    "~/get_brake": "control_board_msgs/srv/GetBrake",
    "~/get_coupling": "control_board_msgs/srv/GetCoupling",
    "~/stop": "control_board_msgs/srv/Stop",
    "~/get_faults": "control_board_msgs/srv/GetFaults",
    "~/recover": "control_board_msgs/srv/Recover",
    "~/get_freeze_frame": "control_board_msgs/srv/GetFreezeFrame",
    "~/emergency_stop": "std_srvs/srv/SetBool",
    "~/list_poses": "control_board_msgs/srv/ListPoses",
    "~/save_pose": "control_board_msgs/srv/SavePose",
    "~/get_motors": "control_board_msgs/srv/GetMotors",
    "~/set_motors": "control_board_msgs/srv/SetMotors",
    "~/get_pids": "control_board_msgs/srv/GetPids",
    "~/set_pids": "control_board_msgs/srv/SetPids",
    "~/set_encoders": "control_board_msgs/srv/SetEncoders",
    "~/configure": "std_srvs/srv/Trigger",
    "~/power_cycle": "std_srvs/srv/Trigger",
    "~/inject_fault": "control_board_msgs/srv/InjectFault",
    "~/clear_injected_faults": "std_srvs/srv/Trigger",
    "~/pause": "std_srvs/srv/SetBool",
    "~/step": "control_board_msgs/srv/Step",
    "~/reset": "std_srvs/srv/Trigger",
}

ACTIONS = {
    "~/calibrate": "control_board_msgs/action/Calibrate",
    "~/move": "control_board_msgs/action/Move",
    "~/go_to_pose": "control_board_msgs/action/GoToPose",
    "~/follow_joint_trajectory": "control_msgs/action/FollowJointTrajectory",
}

#: Only with yarp_interface; below yarp_msgs_name instead of the node's name.
YARP_PUBLISHED = {
    "joint_states/controlModes": ("std_msgs/msg/Int8MultiArray", "RV"),
    "joint_states/controlModeVocabs": ("std_msgs/msg/Int32MultiArray", "RV"),
}
YARP_SUBSCRIBED = {
    "~/position": ("yarp_control_msgs/msg/Position", "RV"),
    "~/position_direct": ("yarp_control_msgs/msg/PositionDirect", "RV"),
    "~/velocity": ("yarp_control_msgs/msg/Velocity", "RV"),
}
YARP_SERVICES = {
    "~/get_modes": "yarp_control_msgs/srv/GetControlModes",
    "~/set_modes": "yarp_control_msgs/srv/SetControlModes",
    "~/get_position": "yarp_control_msgs/srv/GetPosition",
    "~/get_velocity": "yarp_control_msgs/srv/GetVelocity",
    "~/get_available_modes": "yarp_control_msgs/srv/GetAvailableControlModes",
    "~/get_joints_names": "yarp_control_msgs/srv/GetJointsNames",
}
