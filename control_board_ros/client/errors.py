# SPDX-License-Identifier: Apache-2.0
"""Connection errors of the client. A refusal of the board is a Reply, not an error."""


class BoardError(Exception):
    """A board does not answer; one line: cause and next step."""


class BoardNotFound(BoardError):  # noqa: N818  (the user's word)
    """No board of this name appeared within the find timeout."""


class BoardTimeout(BoardError):  # noqa: N818
    """The board was found and did not answer within the answer timeout."""


class InvalidAnswer(BoardError):  # noqa: N818
    """A response of a board is not valid.

    Attributes: unknown_mode (whether a mode code is unknown; otherwise the form is wrong).
    """

    def __init__(self, text: str, *, unknown_mode: bool = False) -> None:
        super().__init__(text)
        self.unknown_mode = unknown_mode


def one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
