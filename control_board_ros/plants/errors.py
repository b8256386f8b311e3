# SPDX-License-Identifier: Apache-2.0
"""Errors about plants of somebody else, each one line for people."""


class PlantSettingsError(ValueError):
    """A plant that cannot be had as asked."""
