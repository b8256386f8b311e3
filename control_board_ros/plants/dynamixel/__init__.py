# SPDX-License-Identifier: Apache-2.0
"""Dynamixel X servos of ROBOTIS, protocol 2: ``driver``, and their ``virtual`` twins."""
