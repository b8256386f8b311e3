# SPDX-License-Identifier: Apache-2.0
"""The specification, rule by rule: a test's docstring begins with the rules it proves."""
