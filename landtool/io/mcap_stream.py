"""The records of an MCAP file in file order: whole, cut short, without an index, or with damaged chunks.

The mcap library's own readers give nothing from a cut file in their default order, check no CRC in a file without
an index, and read an unknown compression as zero messages; so the frame of the records is walked here, and the
library only parses them.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, MessageIndex, Metadata, Schema

from landtool.errors import InputError
from landtool.io.mcap_index import MAGIC, RECORD_HEAD, Parser, parse_record, read_index

_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQII")
_CHUNK_LIMIT = 2 << 30  # writers make chunks of a few MiB; a size beyond this is damage, not data
_COMPRESSIONS = ("", "zstd", "lz4")


@dataclass(frozen=True)
class LogMessage:
    """One message: its channel, the time it was logged, its bytes (a view that lives as long as it is held).

    publish_time_ns, sequence: as its publisher gave them.
    """

    channel: Channel
    log_time_ns: int
    data: memoryview
    publish_time_ns: int
    sequence: int


@dataclass(frozen=True)
class LostChunk:
    """A chunk that could not be read. log_times_ns: what it held by channel id; empty when nothing tells."""

    reason: str
    log_times_ns: dict[int, tuple[int, ...]]


class _DamagedError(Exception):
    """A chunk that has to be given up; the text is the reason."""


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
                self.index = read_index(file)
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
                return parse_record(Header, memoryview(content)) if opcode == Opcode.HEADER else None
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

    def read_extras(self) -> Iterator[Attachment | Metadata]:
        """Give the attachments and metadata records in file order; a broken one is noted."""
        kinds: dict[int, type[Parser[Attachment | Metadata]]] = {
            Opcode.ATTACHMENT: Attachment,
            Opcode.METADATA: Metadata,
        }
        with self.path.open("rb") as file:
            for opcode, content, _ in self._records(file, tuple(kinds)):
                record = parse_record(kinds[opcode], memoryview(content)) if opcode in kinds else None
                if record is not None:
                    yield record
                elif opcode in kinds:
                    self.note("an attachment or metadata record is broken")

    def note(self, text: str) -> None:
        """Add a sentence once."""
        if text not in self.notes:
            self.notes.append(text)

    def _records(self, file: BinaryIO, opcodes: Collection[int] | None = None) -> Iterator[tuple[int, bytes, bool]]:
        """Give opcode, content and whether the file ends inside it, of each record up to the end of the data.

        opcodes: the kinds whose content is read; a chunk that is cut or lost is given all the same.
        """
        size = file.seek(0, 2)
        file.seek(0)
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError("is no MCAP log", file=self.path, hint="give a file that starts with MCAP's magic bytes")
        at = len(MAGIC)
        while True:
            head = file.read(RECORD_HEAD.size)
            opcode, length = RECORD_HEAD.unpack(head) if len(head) == RECORD_HEAD.size else (0, 0)
            start, at = at, at + RECORD_HEAD.size + length
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
            if opcode in (opcodes or _READ_OPCODES):
                yield opcode, file.read(length), False
            else:
                file.seek(at)

    def _next_chunk(self, after: int) -> int | None:
        """Return where the index says the next chunk starts, to go on behind damage."""
        return min((start for start in self._chunk_starts if start > after), default=None)

    def _record(self, opcode: int, content: memoryview, topics: Collection[str] | None) -> Iterator[LogMessage]:
        """Take in one record that is no chunk; give it when it is a wanted message."""
        if opcode == Opcode.MESSAGE and len(content) >= _MESSAGE_HEAD.size:
            channel_id, sequence, log_time_ns, publish_time_ns = _MESSAGE_HEAD.unpack_from(content)
            channel = self.channels.get(channel_id)
            if channel is None:
                self.note(f"messages of channel {channel_id} are left out: the log does not say what it is")
            elif topics is None or channel.topic in topics:
                data = content[_MESSAGE_HEAD.size :]
                yield LogMessage(channel, log_time_ns, data, publish_time_ns, sequence)
        elif opcode == Opcode.SCHEMA and (schema := parse_record(Schema, content)):
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL and (new := parse_record(Channel, content)):
            self.channels[new.id] = new
        elif opcode == Opcode.HEADER:
            self.header = parse_record(Header, content)

    def _inside(self, chunk: memoryview, topics: Collection[str] | None, cut: bool) -> Iterator[LogMessage]:
        """Give the wanted messages of an uncompressed chunk; of a cut one those that are whole."""
        at = 0
        while at + RECORD_HEAD.size <= len(chunk):
            opcode, length = RECORD_HEAD.unpack_from(chunk, at)
            at += RECORD_HEAD.size
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
        index = parse_record(MessageIndex, memoryview(content))
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
