# SPDX-License-Identifier: Apache-2.0
"""Schemas of messages and services."""

from __future__ import annotations

from functools import cache

from foxglove import MessageSchema, Schema, ServiceSchema

from ..recording.definitions import definition, share_file, whole_text

ENCODING, DEFINITIONS = "cdr", "ros2msg"


@cache
def schema(type_name: str) -> Schema:
    """The schema of ``package/msg/Name``.

    Raises:
        RecordingError: its package is not installed.
    """
    return Schema(name=type_name, encoding=DEFINITIONS, data=definition(type_name).text.encode())


@cache
def service_schema(type_name: str) -> ServiceSchema:
    """The schema of ``package/srv/Name``: its messages are ``…_Request`` and ``…_Response``."""
    request, _, response = share_file(type_name, ".srv").read_text("utf-8").partition("---\n")

    def half(name: str, text: str) -> MessageSchema:
        data = whole_text(type_name, text).encode()
        made = Schema(name=f"{type_name}_{name}", encoding=DEFINITIONS, data=data)
        return MessageSchema(encoding=ENCODING, schema=made)

    return ServiceSchema(
        type_name, request=half("Request", request), response=half("Response", response)
    )
