# SPDX-License-Identifier: Apache-2.0
from spec import profiles

profiles.choose()
