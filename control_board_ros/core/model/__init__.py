# SPDX-License-Identifier: Apache-2.0
"""Rigid-body dynamics of the arm, and what lets the modules of it be compiled."""
