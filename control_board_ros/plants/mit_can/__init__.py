# SPDX-License-Identifier: Apache-2.0
"""Damiao motors in MIT mode on CAN: ``driver``, and their ``virtual`` twins."""
