# SPDX-License-Identifier: Apache-2.0
"""What a board is configured to be: parameters, their checks, joints, limits."""
