"""The records of an MCAP file in file order: whole, cut short, without an index, or with damaged chunks.

The mcap library's own readers give nothing from a cut file in their default order, check no CRC in a file without
an index, and read an unknown compression as zero messages; so the frame of the records is walked here, and the
library only parses them.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Protocol, TypeVar

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex, Footer, Header, MessageIndex, Schema, Statistics

from landtool.errors import InputError

MAGIC = b"\x89MCAP0\r\n"
_RECORD_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQII")
_FOOTER_BYTES = _RECORD_HEAD.size + 20
_CHUNK_LIMIT = 2 << 30  # writers make chunks of a few MiB; a size beyond this is damage, not data
_COMPRESSIONS = ("", "zstd", "lz4")


@dataclass(frozen=True)
class LogMessage:
    """One message: its channel, the time it was logged, its bytes (a view that lives as long as it is held)."""

    channel: Channel
    log_time_ns: int
    data: memoryview


@dataclass(frozen=True)
class LostChunk:
    """A chunk that could not be read. log_times_ns: what it held by channel id; empty when nothing tells."""

    reason: str
    log_times_ns: dict[int, tuple[int, ...]]


@dataclass(frozen=True)
class LogIndex:
    """The summary at the end of a finished log."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    statistics: Statistics | None = None


class _DamagedError(Exception):
    """A chunk that has to be given up; the text is the reason."""


_Record = TypeVar("_Record", covariant=True)


class _Parser(Protocol[_Record]):
    @staticmethod
    def read(stream: ReadDataStream) -> _Record: ...


class LogReader:
    """Reads a log from start to end, once.

    schemas, channels: by id, known so far. header: None until met. index: the summary, None without one.
    truncated: the data stops before its end record. notes: what is wrong, one sentence each.
    Raises InputError when the file is no MCAP log.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.header: Header | None = None
        self.truncated = False
        self.notes: list[str] = []
        try:
            with path.open("rb") as file:
                self.index = _read_index(file)
        except OSError as error:
            raise InputError(f"cannot be read ({error.strerror})", file=path, hint="check its permissions") from None
        # a chunk that is lost may have held the only other copy of these
        self.schemas = dict(self.index.schemas) if self.index else {}
        self.channels = dict(self.index.channels) if self.index else {}
        self._chunk_starts = {chunk.chunk_start_offset for chunk in self.index.chunks} if self.index else set()

    def read_header(self) -> Header | None:
        """Return the first record, which says who wrote the log; None when it is damaged."""
        with self.path.open("rb") as file:
            for opcode, content, _ in self._records(file):
                return _parse(Header, memoryview(content)) if opcode == Opcode.HEADER else None
        return None

    def read(self, topics: Collection[str] | None = None) -> Iterator[LogMessage | LostChunk]:
        """Give the messages of `topics` (None: all) in file order, and what was lost between them.

        Raises InputError for a chunk in a compression that is not known.
        """
        lost: LostChunk | None = None
        with self.path.open("rb") as file:
            for opcode, content, cut in self._records(file):
                if lost and opcode == Opcode.MESSAGE_INDEX:
                    lost.log_times_ns.update(self._lost_times(content))
                    continue
                if lost:
                    yield lost
                    lost = None
                if opcode == Opcode.CHUNK:
                    try:
                        chunk = self._open_chunk(content, cut)
                    except _DamagedError as damage:
                        lost = LostChunk(str(damage), {})
                        continue
                    yield from self._inside(chunk, topics, cut)
                else:
                    yield from self._record(opcode, memoryview(content), topics)
        if lost:
            yield lost

    def note(self, text: str) -> None:
        """Add a sentence once."""
        if text not in self.notes:
            self.notes.append(text)

    def _records(self, file: BinaryIO) -> Iterator[tuple[int, bytes, bool]]:
        """Give opcode, content and whether the file ends inside it, of each record up to the end of the data."""
        size = file.seek(0, 2)
        file.seek(0)
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError("is no MCAP log", file=self.path, hint="give a file that starts with MCAP's magic bytes")
        at = len(MAGIC)
        while True:
            head = file.read(_RECORD_HEAD.size)
            opcode, length = _RECORD_HEAD.unpack(head) if len(head) == _RECORD_HEAD.size else (0, 0)
            start, at = at, at + _RECORD_HEAD.size + length
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                return
            if opcode == 0 or at > size:
                if (resume := self._next_chunk(start)) is not None:
                    self.note(f"the log is damaged at byte {start}, read on from byte {resume}")
                    if start in self._chunk_starts:
                        yield Opcode.CHUNK, b"", False  # counts as a chunk that is lost
                    at = file.seek(resume)
                    continue
                self.truncated = True
                self.note(f"the log is cut at byte {start} of {size}")
                if opcode == Opcode.CHUNK:
                    yield opcode, file.read(), True
                return
            if opcode in _READ_OPCODES:
                yield opcode, file.read(length), False
            else:
                file.seek(at)

    def _next_chunk(self, after: int) -> int | None:
        """Return where the index says the next chunk starts, to go on behind damage."""
        return min((start for start in self._chunk_starts if start > after), default=None)

    def _record(self, opcode: int, content: memoryview, topics: Collection[str] | None) -> Iterator[LogMessage]:
        """Take in one record that is no chunk; give it when it is a wanted message."""
        if opcode == Opcode.MESSAGE and len(content) >= _MESSAGE_HEAD.size:
            channel_id, _, log_time_ns, _ = _MESSAGE_HEAD.unpack_from(content)
            channel = self.channels.get(channel_id)
            if channel is None:
                self.note(f"messages of channel {channel_id} are left out: the log does not say what it is")
            elif topics is None or channel.topic in topics:
                yield LogMessage(channel, log_time_ns, content[_MESSAGE_HEAD.size :])
        elif opcode == Opcode.SCHEMA and (schema := _parse(Schema, content)):
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL and (new := _parse(Channel, content)):
            self.channels[new.id] = new
        elif opcode == Opcode.HEADER:
            self.header = _parse(Header, content)

    def _inside(self, chunk: memoryview, topics: Collection[str] | None, cut: bool) -> Iterator[LogMessage]:
        """Give the wanted messages of an uncompressed chunk; of a cut one those that are whole."""
        at = 0
        while at + _RECORD_HEAD.size <= len(chunk):
            opcode, length = _RECORD_HEAD.unpack_from(chunk, at)
            at += _RECORD_HEAD.size
            if at + length > len(chunk):
                break
            yield from self._record(opcode, chunk[at : at + length], topics)
            at += length
        if at != len(chunk) and not cut:
            self.truncated = True
            self.note("a chunk ends inside a record")

    def _open_chunk(self, content: bytes, cut: bool) -> memoryview:
        """Return a chunk's records, decompressed and checked; of a cut chunk what there is, unchecked."""
        if len(content) < _CHUNK_HEAD.size:
            raise _DamagedError("a chunk's head is damaged")
        _, _, size, crc, name_length = _CHUNK_HEAD.unpack_from(content)
        body = _CHUNK_HEAD.size + name_length + 8
        name = content[_CHUNK_HEAD.size : body - 8]
        if name_length > 32 or not name.decode("latin-1").isprintable() or size > _CHUNK_LIMIT:
            raise _DamagedError("a chunk's head is damaged")
        compression = name.decode("latin-1")
        if compression not in _COMPRESSIONS:
            hint = "write the log again with zstd, lz4 or no compression"
            raise InputError(f"a chunk's compression '{compression}' is not known", file=self.path, hint=hint)
        data = _decompress(compression, memoryview(content)[body:], size)
        if not cut and len(data) != size:
            raise _DamagedError(f"a chunk gives {len(data)} of its {size} bytes")
        if not cut and crc and zlib.crc32(data) != crc:
            raise _DamagedError("a chunk's CRC does not match its data")
        return data

    def _lost_times(self, content: bytes) -> dict[int, tuple[int, ...]]:
        index = _parse(MessageIndex, memoryview(content))
        return {} if index is None else {index.channel_id: tuple(time_ns for time_ns, _ in index.records)}


_READ_OPCODES = (
    Opcode.HEADER,
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.MESSAGE,
    Opcode.CHUNK,
    Opcode.MESSAGE_INDEX,
)


def _decompress(compression: str, data: memoryview, size: int) -> memoryview:
    """Return up to `size` bytes; fewer when the data ends early. Raises _DamagedError for data that is not valid."""
    try:
        if compression == "zstd":
            return memoryview(zstandard.ZstdDecompressor().stream_reader(data).read(size))
        if compression == "lz4":
            return memoryview(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size))
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError) as error:
        raise _DamagedError(f"a chunk cannot be decompressed ({error})") from None
    return data[:size]


def _parse(kind: type[_Parser[_Record]], content: memoryview) -> _Record | None:
    """Parse a record; None when its bytes make no sense."""
    try:
        return kind.read(ReadDataStream(BytesIO(content)))
    except (McapError, struct.error, UnicodeDecodeError):
        return None


def _read_index(file: BinaryIO) -> LogIndex | None:
    """Read the summary; None when there is none, or its CRC says it is damaged."""
    size = file.seek(0, 2)
    if size < len(MAGIC) * 2 + _FOOTER_BYTES:
        return None
    file.seek(size - len(MAGIC) - _FOOTER_BYTES)
    tail = file.read()
    footer = _parse(Footer, memoryview(tail)[_RECORD_HEAD.size : _FOOTER_BYTES])
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
    while at + _RECORD_HEAD.size <= len(records):
        opcode, length = _RECORD_HEAD.unpack_from(records, at)
        content = records[at + _RECORD_HEAD.size : at + _RECORD_HEAD.size + length]
        at += _RECORD_HEAD.size + length
        if opcode == Opcode.SCHEMA and (schema := _parse(Schema, content)):
            schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL and (channel := _parse(Channel, content)):
            channels[channel.id] = channel
        elif opcode == Opcode.CHUNK_INDEX and (chunk := _parse(ChunkIndex, content)):
            chunks.append(chunk)
        elif opcode == Opcode.STATISTICS:
            statistics = _parse(Statistics, content)
    return LogIndex(schemas, channels, chunks, statistics)
