"""An MCAP log as it is written: channels, messages by time, attachments, the record of its making."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.writer import CompressionType, Writer

from landtool import __version__
from landtool.errors import UsageError
from landtool.io.mcap_build import DIALECTS, McapSchema
from landtool.io.mcap_proto import Built

CHUNK_BYTES = 1 << 20
STAMP_LIMIT_NS = 2**31 * 1_000_000_000  # a ROS stamp has int32 seconds


def checked_stamp_ns(t_ns: int | None) -> int:
    """Return a time a log can hold. Raises UsageError for any other, and for none."""
    if t_ns is None:
        raise UsageError("frames without times cannot be written to an MCAP log", hint="give the input a --fps")
    if not 0 <= t_ns < STAMP_LIMIT_NS:
        raise UsageError(f"the time {t_ns} ns does not fit an MCAP log", hint="write a video instead")
    return t_ns


class McapLog:
    """Writes messages of one schema to zstd chunks with an index, statistics and the metadata record `landtool`.

    The time of logging is the message's own, or the one before where that is later: it never goes back. Nothing of the
    moment of writing enters the file, so the same input gives the same bytes. Writes to `path` as it goes; use it
    inside `atomic_path` for a file that appears whole. Raises UsageError for a message without a time, OSError when
    writing fails.
    """

    def __init__(self, path: Path, *, schema: McapSchema) -> None:
        self.path = Path(path)
        self.dialect = DIALECTS[schema]()
        self._schema_ids: dict[str, int] = {}
        self._channel_ids: dict[str, int] = {}
        self._sequences: dict[int, int] = {}
        self._latest_ns = 0
        self._file = self.path.open("wb")
        self._log = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._log.start(profile=self.dialect.profile, library=f"landtool/{__version__}")

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._file.closed

    def add(self, topic: str, t_ns: int | None, message: Built) -> None:
        """Add a message at its time; its topic has messages of one type."""
        stamp_ns = checked_stamp_ns(t_ns)
        self._latest_ns = max(self._latest_ns, stamp_ns)
        channel = self._channel_ids.get(topic)
        if channel is None:
            channel = self._channel_ids[topic] = self._register(topic, message.type)
        sequence = self._sequences[channel] = self._sequences.get(channel, -1) + 1
        self._log.add_message(channel, self._latest_ns, message.data, stamp_ns, sequence)

    def attach(self, name: str, media_type: str, text: str) -> None:
        """Add a text as a file of its own; it has no time."""
        self._log.add_attachment(0, 0, name, media_type, text.encode())

    def describe(self, facts: Mapping[str, str]) -> None:
        """Write the record `landtool`: the version and what else is to be said of the log's making."""
        self._log.add_metadata("landtool", {"version": __version__, **facts})

    def close(self) -> None:
        """Write the index and close the file; may be called again."""
        if self._file.closed:
            return
        try:
            self._log.finish()  # type: ignore[no-untyped-call]
        finally:
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        self._file.close()

    def _register(self, topic: str, type_name: str) -> int:
        dialect = self.dialect
        if type_name not in self._schema_ids:
            definition = dialect.definition(type_name)
            self._schema_ids[type_name] = self._log.register_schema(type_name, dialect.schema_encoding, definition)
        return self._log.register_channel(topic, dialect.message_encoding, self._schema_ids[type_name])
