# SPDX-License-Identifier: Apache-2.0
"""The command line as it is written: words, units, arguments, options."""
