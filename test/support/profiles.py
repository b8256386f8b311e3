# SPDX-License-Identifier: Apache-2.0
"""How hypothesis searches: the same examples in every run, unless asked to explore.

``HYPOTHESIS_PROFILE=explore`` tries other examples in each run, and many more of them.
"""

from __future__ import annotations

import os

from hypothesis import HealthCheck, settings

settings.register_profile(
    "steady",
    deadline=None,
    derandomize=True,
    database=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile(
    "explore", settings.get_profile("steady"), derandomize=False, max_examples=1000
)


def choose() -> None:
    """Load the profile that the environment names."""
    settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))
