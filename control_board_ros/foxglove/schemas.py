# SPDX-License-Identifier: Apache-2.0
"""Definitions of topics and services as Foxglove wants them (``ros2msg``)."""

from __future__ import annotations

from functools import cache

from foxglove import MessageSchema, Schema, ServiceSchema

from control_board_ros.recording.definitions import SEPARATOR, definition, referred, share_file

ENCODING, DEFINITIONS = "cdr", "ros2msg"


@cache
def schema(type_name: str) -> Schema:
    """That of ``package/msg/Name``.

    Raises:
        RecordingError: its package is not installed.
    """
    return Schema(name=type_name, encoding=DEFINITIONS, data=definition(type_name).text.encode())


@cache
def service_schema(type_name: str) -> ServiceSchema:
    """That of ``package/srv/Name``, whose halves are named ``…_Request`` and ``…_Response``."""
    request, _, response = share_file(type_name, ".srv").read_text("utf-8").partition("---\n")
    halves = {"Request": request, "Response": response}
    made = {
        half: MessageSchema(
            encoding=ENCODING,
            schema=Schema(
                name=f"{type_name}_{half}",
                encoding=DEFINITIONS,
                data=with_parts(type_name, text).encode(),
            ),
        )
        for half, text in halves.items()
    }
    return ServiceSchema(type_name, request=made["Request"], response=made["Response"])


def with_parts(type_name: str, text: str) -> str:
    """Half of a service with the definitions that it refers to."""
    parts = [text.rstrip("\n")]
    for name in dict.fromkeys(referred(type_name, text)):
        package, _, message = name.split("/")
        parts.append(
            f"{SEPARATOR}\nMSG: {package}/{message}\n{definition(name).text}".rstrip("\n")
        )
    return "\n".join(parts) + "\n"
