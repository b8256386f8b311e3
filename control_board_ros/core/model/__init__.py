# SPDX-License-Identifier: Apache-2.0
"""Rigid-body dynamics of the arm, and the couplings of its joints."""
