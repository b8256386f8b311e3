# SPDX-License-Identifier: Apache-2.0
"""What verbs share to ask a board: sessions, progress, recordings, streams."""
