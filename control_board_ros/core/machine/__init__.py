# SPDX-License-Identifier: Apache-2.0
"""The mode machine: which mode may follow which, and on whose request."""
