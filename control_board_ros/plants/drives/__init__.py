# SPDX-License-Identifier: Apache-2.0
"""What the drivers in the box share: axes, options, one plant for the drives of one bus."""
