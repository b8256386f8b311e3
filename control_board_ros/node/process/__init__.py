# SPDX-License-Identifier: Apache-2.0
"""The process: its nodes, its console, its start and its end."""
