# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions (URDF): read, checked, cut, and what is derived from them."""
