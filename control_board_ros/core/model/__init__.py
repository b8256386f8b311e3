# SPDX-License-Identifier: Apache-2.0
"""Rigid-body dynamics of the arm, and the stand-in for Cython that compiled modules import."""
