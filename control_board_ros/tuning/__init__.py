# SPDX-License-Identifier: Apache-2.0
"""A search for gains, on the board without ROS: ``python -m control_board_ros.tuning``.

``bench`` plays motions of a joint with given gains, ``cost`` evaluates them, ``space`` defines the
variables, ``search`` optimises with Optuna in several processes, ``outcome`` compares with the
present gains, and ``files`` writes the result.
"""


class TuningError(Exception):
    """One line: cause and next step."""
