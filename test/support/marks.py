# SPDX-License-Identifier: Apache-2.0
"""Marks of tests that need an optional package."""

from importlib.util import find_spec

import pytest

#: The iCub's URDF, of the extra ``icub``.
needs_icub = pytest.mark.skipif(find_spec("icub_models") is None, reason="extra icub")
