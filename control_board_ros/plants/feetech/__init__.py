# SPDX-License-Identifier: Apache-2.0
"""Feetech STS servos: ``driver``, and their ``virtual`` twins."""
