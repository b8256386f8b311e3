# SPDX-License-Identifier: Apache-2.0
"""What goes wrong with a search."""


class TuningError(Exception):
    """One line: what does not work, and what to do."""
