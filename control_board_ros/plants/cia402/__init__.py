# SPDX-License-Identifier: Apache-2.0
"""CiA 402 drives over CANopen: ``driver``, and their ``virtual`` twins."""
