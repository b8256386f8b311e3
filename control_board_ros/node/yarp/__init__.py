# SPDX-License-Identifier: Apache-2.0
"""The interface of YARP's controlBoard_nws_ros2."""
