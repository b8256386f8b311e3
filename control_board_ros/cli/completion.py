# SPDX-License-Identifier: Apache-2.0
"""Completion with Tab, in the shell of cbctl and in bash, zsh and fish."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from .board.boards import boards_meant
from .board.session import Session
from .line.arguments import Argument, arguments_of
from .line.offers import Typed
from .line.options import ARGUMENTS, Options, hoist, read_options
from .line.words import Refused, UsageError
from .text.output import DONE, put

#: Timeout for finding a board and for its answers, s: Tab must not hang.
TIMEOUT = 2.0

#: Script of each shell; it requests the words at the cursor from cbctl.
SCRIPTS = {
    "bash": """\
_cbctl() {
    local IFS=$'\\n'
    COMPREPLY=($(COMP_WORDS="${COMP_WORDS[*]}" COMP_CWORD=$COMP_CWORD _CBCTL_COMPLETE=bash "$1"))
    [[ ${#COMPREPLY[@]} == 1 && ${COMPREPLY[0]} == *[=.] ]] && compopt -o nospace
}
complete -o default -F _cbctl cbctl""",
    "zsh": """\
#compdef cbctl
_cbctl() {
    local -a found
    found=("${(@f)$(COMP_WORDS="${words[*]}" COMP_CWORD=$((CURRENT - 1)) \\
        _CBCTL_COMPLETE=zsh cbctl)}")
    compadd -S '' -- ${(M)found:#*[=.]}
    compadd -- ${found:#*[=.]}
}
compdef _cbctl cbctl""",
    "fish": """\
function __cbctl
    env _CBCTL_COMPLETE=fish COMP_WORDS=(commandline -cp | string collect) \\
        COMP_CWORD=(count (commandline -opc)) cbctl
end
complete -c cbctl -f -a '(__cbctl)'""",
}


def offers(
    verb: Callable[..., Any],
    before: Sequence[str],
    incomplete: str,
    joints: Callable[[], Sequence[str]],
    poses: Callable[[], Sequence[str]] = tuple,
) -> list[str]:
    """The words that may follow on the line of a verb.

    Args:
        verb: its function.
        before: the words between the verb and the one that is typed.
        incomplete: the characters typed of it.
        joints: reads the joints of the board.
        poses: reads its poses.
    """
    if incomplete.startswith("-"):
        return []
    typed = Typed(before, incomplete, joints, poses)
    found = [
        word
        for entry in arguments_of(verb)
        if entry.positional and entry.offers is not None
        for word in entry.offers(typed)
    ]
    return [word for word in found if word.startswith(incomplete)]


def line_offers(
    line: str,
    verbs: Sequence[str],
    load: Callable[[str], Any],
    names: Sequence[str],
    more: Sequence[str] = (),
    poses: Callable[[], Sequence[str]] = tuple,
) -> list[str]:
    """The words that may follow a line in the shell of cbctl.

    Args:
        line: up to the cursor.
        verbs: of cbctl.
        load: gives the function of a verb.
        names: the joints of the board.
        more: words of the shell itself; the first two of them show help.
        poses: reads the poses of the board.
    """
    *before, incomplete = line.split(" ")
    before = [word for word in before if word]
    if before[:1] == ["cbctl"]:
        before = before[1:]
    known = [verb for verb in verbs if verb != "shell"]
    if not before:
        return [word for word in (*known, *more) if word.startswith(incomplete)]
    if before[0] in more[:2] and len(before) == 1:
        return [verb for verb in known if verb.startswith(incomplete)]
    if before[0] not in known:
        return []
    return offers(load(before[0]), before[1:], incomplete, lambda: names, poses)


def complete(
    environment: Mapping[str, str], verbs: Sequence[str], load: Callable[[str], Any]
) -> int:
    """Print the words that may follow at the cursor, a line each; returns the exit code.

    Args:
        environment: with COMP_WORDS, the line, and COMP_CWORD, the index of the word at the
            cursor.
        verbs: of cbctl.
        load: gives the function of a verb.
    """
    words, k = environment.get("COMP_WORDS", "").split(), int(environment.get("COMP_CWORD", 0))
    incomplete = words[k] if k < len(words) else ""
    try:
        found = at_cursor(words[1:k], incomplete, verbs, load)
    except UsageError:  # the value of an option is typed
        found = []
    for word in found:
        put(word)
    return DONE


def at_cursor(
    words: Sequence[str], incomplete: str, verbs: Sequence[str], load: Callable[[str], Any]
) -> list[str]:
    """The words that fit: verbs, options, or arguments of the verb from the present board.

    Raises:
        UsageError: an option has no value yet.
    """
    if words and words[-1] == "--board":
        front, _ = hoist(words[:-1])
        options, _ = read_options(front, [])
        return [board for board in all_boards(options) if board.startswith(incomplete)]
    front, rest = hoist(words)
    options, _ = read_options(front, [])
    if incomplete.startswith("-"):
        known = arguments_of(load(rest[0])) if rest and rest[0] in verbs else ()
        flags = [flag for entry in (*known, *ARGUMENTS) for flag in flags_of(entry)]
        return [flag for flag in (*flags, "--help") if flag.startswith(incomplete)]
    if not rest:
        return [verb for verb in verbs if verb.startswith(incomplete)]
    if rest[0] not in verbs:
        return []
    options.timeout = TIMEOUT
    with Session(options) as session:
        joints, poses = partial(list_joints, session), partial(list_poses, session)
        return offers(load(rest[0]), rest[1:], incomplete, joints, poses)


def flags_of(entry: Argument) -> list[str]:
    """The long names of an option."""
    return [name for name in entry.names if name.startswith("--")]


def all_boards(options: Options) -> list[str]:
    """The names of the discovered boards."""
    with Session(replace(options, board="/*", timeout=TIMEOUT)) as session:
        try:
            return boards_meant(session)
        except Refused:
            return []


def list_joints(session: Session) -> Sequence[str]:
    """The joints of the board; none without a board."""
    from control_board_ros.client import BoardError

    try:
        return session.names
    except BoardError:
        return ()


def list_poses(session: Session) -> Sequence[str]:
    """The poses of the board; none where it does not report them."""
    from control_board_ros.client import BoardError
    from control_board_ros.core.selection import RequestError

    try:
        return session.client.list_poses()
    except (BoardError, RequestError):
        return ()
