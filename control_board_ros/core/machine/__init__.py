# SPDX-License-Identifier: Apache-2.0
"""The mode machine: what may follow what, and who asked for it."""
