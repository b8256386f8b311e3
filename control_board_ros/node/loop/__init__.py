# SPDX-License-Identifier: Apache-2.0
"""The control loop: its thread, its time and its snapshots."""
