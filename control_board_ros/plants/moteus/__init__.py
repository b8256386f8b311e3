# SPDX-License-Identifier: Apache-2.0
"""moteus controllers of mjbots on CAN FD: ``driver``, and their ``virtual`` twins."""
