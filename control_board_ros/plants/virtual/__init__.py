# SPDX-License-Identifier: Apache-2.0
"""Virtual drives on virtual buses, that move a body of ours: ``plant:=virtual/moteus``."""
