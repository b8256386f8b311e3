# SPDX-License-Identifier: Apache-2.0
"""cbctl completion."""

from __future__ import annotations

from typing import Annotated

import typer

from ..words import UsageError

SHELLS = ("bash", "zsh", "fish")


def completion(
    shell: Annotated[str, typer.Argument(metavar="SHELL", help=", ".join(SHELLS))] = "bash",
) -> None:
    """Print the completion script of a shell: source <(cbctl completion bash)."""
    from typer._completion_shared import get_completion_script

    if shell not in SHELLS:
        raise UsageError(f"shell {shell!r} is not known; one of {', '.join(SHELLS)}")
    print(get_completion_script(prog_name="cbctl", complete_var="_CBCTL_COMPLETE", shell=shell))
