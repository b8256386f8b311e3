# SPDX-License-Identifier: Apache-2.0
"""A search for gains, on the board without ROS: ``python -m control_board_ros.tuning``.

``bench`` plays motions of a joint with some gains, ``cost`` makes one number of them, ``space``
says what is varied, ``search`` looks for the best with Optuna in several processes, ``outcome``
holds it against the gains of before, and ``files`` writes what was found.
"""
