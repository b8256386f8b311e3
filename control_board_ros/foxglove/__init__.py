# SPDX-License-Identifier: Apache-2.0
"""A live server for Foxglove (``cbctl foxglove``): a board's topics, services and parameters."""
