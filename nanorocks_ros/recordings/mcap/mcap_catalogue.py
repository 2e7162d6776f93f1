"""Channels and schemas of an MCAP file, by their ids.

Tested by ``test/recordings/mcap/test_mcap_scan.py``.
"""

from __future__ import annotations

from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema


def data_stream(content: memoryview | bytes) -> ReadDataStream:
    """Content of one record as a stream for the `mcap` library."""
    return ReadDataStream(BytesIO(content))


class Catalogue:
    """Channels and schemas read so far, by their ids.

    Attributes
    ----------
    channels : dict of int to mcap.records.Channel
    schemas : dict of int to mcap.records.Schema
    contradictions : set of int
        Channels and schemas of which two copies differ; the first is used.
    """

    def __init__(self) -> None:
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.contradictions: set[int] = set()

    def add(self, opcode: int, content: memoryview) -> None:
        """Add a record if it is a channel or a schema."""
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(data_stream(content))
            if self.schemas.setdefault(schema.id, schema) != schema:
                self.contradictions.add(schema.id)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(data_stream(content))
            if self.channels.setdefault(channel.id, channel) != channel:
                self.contradictions.add(channel.id)
