# SPDX-License-Identifier: Apache-2.0
"""Bodies: masses and joints, ideal or in a physics engine."""
