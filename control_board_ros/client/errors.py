# SPDX-License-Identifier: Apache-2.0
"""What the client raises: trouble with the connection. What a board refuses is a Reply."""


class BoardError(Exception):
    """No answer to be had from a board; one line: cause and next step."""


class BoardNotFound(BoardError):  # noqa: N818  (the user's word)
    """No board of this name appeared within the find timeout."""


class BoardTimeout(BoardError):  # noqa: N818
    """The board is there and did not answer within the answer timeout."""
