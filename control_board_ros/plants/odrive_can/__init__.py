# SPDX-License-Identifier: Apache-2.0
"""ODrive controllers by CAN Simple: ``driver``, and their ``virtual`` twins."""
