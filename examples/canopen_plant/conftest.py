# SPDX-License-Identifier: Apache-2.0
"""The package is found beside its tests, installed or not."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
