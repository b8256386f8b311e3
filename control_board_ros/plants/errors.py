# SPDX-License-Identifier: Apache-2.0
"""Errors about third-party plants, each one line for people."""


class PlantSettingsError(ValueError):
    """A plant cannot be made as configured."""
