"""The index at the end of a finished MCAP log, and how any single record is read."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from io import BytesIO
from typing import BinaryIO, Protocol, TypeVar

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Schema, Statistics

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = struct.Struct("<BQ")
_FOOTER_BYTES = RECORD_HEAD.size + 20


@dataclass(frozen=True)
class LogIndex:
    """The summary at the end of a finished log."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    statistics: Statistics | None = None


_Record = TypeVar("_Record", covariant=True)


class Parser(Protocol[_Record]):
    """A kind of record of the mcap library."""

    @staticmethod
    def read(stream: ReadDataStream) -> _Record:
        """Return the record."""
        ...


def parse_record(kind: type[Parser[_Record]], content: memoryview) -> _Record | None:
    """Parse a record; None when its bytes make no sense."""
    try:
        return kind.read(ReadDataStream(BytesIO(content)))
    except (McapError, struct.error, UnicodeDecodeError):
        return None


def read_index(file: BinaryIO) -> LogIndex | None:
    """Read the summary; None when there is none, or its CRC says it is damaged."""
    size = file.seek(0, 2)
    if size < len(MAGIC) * 2 + _FOOTER_BYTES:
        return None
    file.seek(size - len(MAGIC) - _FOOTER_BYTES)
    tail = file.read()
    footer = parse_record(Footer, memoryview(tail)[RECORD_HEAD.size : _FOOTER_BYTES])
    end = size - len(tail)
    if tail[_FOOTER_BYTES:] != MAGIC or tail[0] != Opcode.FOOTER or not footer or not 0 < footer.summary_start <= end:
        return None
    file.seek(footer.summary_start)
    records = file.read(end - footer.summary_start)
    checked = zlib.crc32(tail[: _FOOTER_BYTES - 4], zlib.crc32(records))
    if footer.summary_crc and footer.summary_crc != checked:
        return None
    return _index_of(memoryview(records))


def _index_of(records: memoryview) -> LogIndex:
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    chunks: list[ChunkIndex] = []
    statistics: Statistics | None = None
    at = 0
    while at + RECORD_HEAD.size <= len(records):
        opcode, length = RECORD_HEAD.unpack_from(records, at)
        content = records[at + RECORD_HEAD.size : at + RECORD_HEAD.size + length]
        at += RECORD_HEAD.size + length
        if opcode == Opcode.SCHEMA and (schema := parse_record(Schema, content)):
            schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL and (channel := parse_record(Channel, content)):
            channels[channel.id] = channel
        elif opcode == Opcode.CHUNK_INDEX and (chunk := parse_record(ChunkIndex, content)):
            chunks.append(chunk)
        elif opcode == Opcode.STATISTICS:
            statistics = parse_record(Statistics, content)
    return LogIndex(schemas, channels, chunks, statistics)
