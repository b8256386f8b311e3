# SPDX-License-Identifier: Apache-2.0
"""What the client raises: trouble with the connection. What a board refuses is a Reply."""


class BoardError(Exception):
    """No answer to be had from a board; one line: cause and next step."""


class BoardNotFound(BoardError):  # noqa: N818  (the user's word)
    """No board of this name appeared within the find timeout."""


class BoardTimeout(BoardError):  # noqa: N818
    """The board is there and did not answer within the answer timeout."""


class InvalidAnswer(BoardError):  # noqa: N818
    """A board answered what none can mean.

    Attributes: unknown_mode (whether it is a code that is no mode's; else the form is wrong).
    """

    def __init__(self, text: str, *, unknown_mode: bool = False) -> None:
        super().__init__(text)
        self.unknown_mode = unknown_mode


def one_line(error: BaseException) -> str:
    """The text of an exception in one line; rclpy's may have several."""
    return " ".join(str(error).split()) or type(error).__name__
