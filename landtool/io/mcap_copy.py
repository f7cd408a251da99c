"""A copy of an MCAP log in which one topic has other pictures, and all else is as it was."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

from mcap.records import Attachment
from mcap.writer import CompressionType, Writer

from landtool import __version__
from landtool.io.mcap import lost_times
from landtool.io.mcap_log import CHUNK_BYTES
from landtool.io.mcap_messages import plain_type
from landtool.io.mcap_replace import PictureReplacer
from landtool.io.mcap_stream import LogMessage, LogReader, LostChunk
from landtool.types import Image


class McapCopy:
    """Writes a log's messages in their order, those of the image topic with the pictures it is given.

    Every message of another topic keeps its bytes, times and sequence, every channel its topic, schema and metadata;
    attachments and metadata records are copied to the front, and the record `landtool` tells of the change. The
    profile stays; the library's name is landtool's own. lost_chunks: parts of the source that cannot be copied.

    Call `write` or `skip` for every frame of a `McapSource` of the same file and topic, in order. Writes to `path` as
    it goes; use it inside `atomic_path`. Raises UsageError as `PictureReplacer` does, OSError when writing fails.
    """

    def __init__(self, source: Path, path: Path, topic: str) -> None:
        self._reader = LogReader(source)
        self._topic = topic
        self._replacer = PictureReplacer(topic)
        self._channel_ids: dict[int, int] = {}
        self._schema_ids = {0: 0}  # MCAP: a channel without one
        self.lost_chunks = 0
        header = self._reader.read_header()
        self._file = path.open("wb")
        self._log = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._log.start(profile=header.profile if header else "", library=f"landtool/{__version__}")
        self._copy_extras()
        self._frames = self._image_messages()

    @property
    def notes(self) -> list[str]:
        """What could not be kept, one sentence each."""
        lost = [f"{self.lost_chunks} parts of the log cannot be read and were left out"] if self.lost_chunks else []
        return [*self._replacer.notes, *self._reader.notes, *lost]

    def write(self, image: Image, *, changed: bool) -> None:
        """Copy up to the next frame's message, and that with the picture (H, W, 3) BGR; as it is if not changed."""
        message = next(self._frames)
        assert message is not None, "a frame was given for a message that is lost"
        schema = self._reader.schemas.get(message.channel.schema_id)
        kind = plain_type(schema.name) if schema else "", message.channel.message_encoding
        self._add(message, self._replacer.put(kind, message.data, image, changed=changed))

    def skip(self) -> None:
        """Copy up to the next frame's message, and that as it is: nothing is known of its picture."""
        message = next(self._frames)
        data = None if message is None else self._replacer.without_picture(message.data)
        if message is not None and data is not None:
            self._add(message, data)

    def close(self) -> None:
        """Copy the rest, write the index and close the file; may be called again."""
        if self._file.closed:
            return
        try:
            for message in self._frames:
                if message is not None:
                    self._add(message, bytes(message.data))
            for number in self._reader.channels:
                self._channel(number)
            self._log.finish()  # type: ignore[no-untyped-call]
        finally:
            self._file.close()

    def __enter__(self) -> McapCopy:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        self._file.close()

    def _image_messages(self) -> Iterator[LogMessage | None]:
        """Give the image topic's messages, None for each that is lost with its chunk; copy the others on the way."""
        for event in self._reader.read():
            if isinstance(event, LostChunk):
                self.lost_chunks += 1
                for _ in lost_times(event, self._reader, self._topic):
                    yield None
            elif event.channel.topic == self._topic:
                yield event
            else:
                self._add(event, bytes(event.data))

    def _add(self, message: LogMessage, data: bytes) -> None:
        channel = self._channel(message.channel.id)
        self._log.add_message(channel, message.log_time_ns, data, message.publish_time_ns, message.sequence)

    def _channel(self, number: int) -> int:
        """Return the id a channel has in the copy; it is added when it is first asked for."""
        if number not in self._channel_ids:
            channel = self._reader.channels[number]
            self._channel_ids[number] = self._log.register_channel(
                channel.topic, channel.message_encoding, self._schema(channel.schema_id), channel.metadata
            )
        return self._channel_ids[number]

    def _schema(self, number: int) -> int:
        schema = self._reader.schemas.get(number)
        if schema is None:
            return 0
        if number not in self._schema_ids:
            self._schema_ids[number] = self._log.register_schema(schema.name, schema.encoding, schema.data)
        return self._schema_ids[number]

    def _copy_extras(self) -> None:
        for record in self._reader.read_extras():
            if isinstance(record, Attachment):
                self._log.add_attachment(
                    record.create_time, record.log_time, record.name, record.media_type, record.data
                )
            else:
                self._log.add_metadata(record.name, record.metadata)
        self._log.add_metadata("landtool", {"version": __version__, "dehazed_topic": self._topic})
