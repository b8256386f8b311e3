# SPDX-License-Identifier: Apache-2.0
"""What watches the joints: monitors, heat, causes of faults, freeze frames."""
