# SPDX-License-Identifier: Apache-2.0
"""The words of the board: vocabs, modes, events, faults, replies and measurements."""
