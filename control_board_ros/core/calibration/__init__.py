# SPDX-License-Identifier: Apache-2.0
"""The calibrators, and their turns."""
