# SPDX-License-Identifier: Apache-2.0
"""The plant: motors, sensors, injected faults, and the bodies they move."""

from ..compiled import choose

choose()
