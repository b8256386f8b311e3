# SPDX-License-Identifier: Apache-2.0
"""The control laws and the references that they follow."""
