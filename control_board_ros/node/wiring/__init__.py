# SPDX-License-Identifier: Apache-2.0
"""The wiring to ROS: messages in, messages out, parameters."""
