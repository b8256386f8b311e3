# SPDX-License-Identifier: Apache-2.0
"""The plant: motors, sensors, the simulated arm, and the settings of all of it."""
