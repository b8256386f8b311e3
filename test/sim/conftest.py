# SPDX-License-Identifier: Apache-2.0
"""Which tests of the simulation there are: some are about an engine that is not everywhere."""

from importlib.util import find_spec

#: pybullet has no wheel for Python from 3.12 on.
WITH_PYBULLET = ["test_bullet.py", "test_every_urdf.py", "test_two_engines.py"]
collect_ignore = WITH_PYBULLET if find_spec("pybullet") is None else []
