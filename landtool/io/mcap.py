"""MCAP logs as a source of frames: one image topic of ROS 2 or Foxglove, in the order of the file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

from mcap.records import Channel, Schema

from landtool.camera import Camera
from landtool.errors import InputError
from landtool.io.mcap_camera import camera_from, is_rectified
from landtool.io.mcap_cdr import BrokenMessageError
from landtool.io.mcap_clock import ClockCheck
from landtool.io.mcap_decoders import Picture, PictureDecoder
from landtool.io.mcap_messages import (
    CALIBRATION_PARSERS,
    IMAGE_PARSERS,
    ImageMessage,
    RawImage,
    parse_calibration,
    parse_image,
    plain_type,
)
from landtool.io.mcap_stream import LogMessage, LogReader, LostChunk
from landtool.io.mcap_summary import McapSummary, McapTopic, describe_mcap
from landtool.io.source import SourceInfo, SourceReport
from landtool.types import Frame, LostFrame

__all__ = ["McapSource", "McapSummary", "McapTopic", "describe_mcap"]


class McapSource:
    """An image topic of an MCAP log as a `Source`: every message of it is a frame or a lost frame.

    Opening reads the log once, without decoding more than the first picture: it decides the clock (`ClockCheck`),
    counts the frames, and finds the camera, the first valid calibration of the topic that belongs to the image.
    Times are the header stamps or, when those do not increase, the times of logging. Order is the file's.
    A log cut short gives all whole messages before the cut, a damaged chunk costs its own.

    Raises UsageError when `topic` does not name an image topic or, without it, there are several; InputError when the
    file is no MCAP log, has no image topic, a compression that is not known, or not one picture.
    """

    def __init__(self, path: Path | str, *, topic: str | None = None) -> None:
        self.path = Path(path)
        self.report = SourceReport()
        self._passes: list[Iterator[Frame | LostFrame]] = []
        summary = describe_mcap(self.path)
        chosen = summary.choose_image_topic(topic)
        look = _Look(self.path, chosen, summary)
        self._clock = look.clock
        self.info = look.info()

    def __iter__(self) -> Iterator[Frame | LostFrame]:
        self.close()
        self.report = SourceReport(declared=self.info.frames_declared, notes=list(self.info.notes))
        frames = _Pass(self.path, self.info.topic, self._clock, self.report).frames()
        self._passes.append(frames)
        return frames

    def close(self) -> None:
        """End the pass under way, if any, and release its file."""
        while self._passes:
            self._passes.pop().close()  # type: ignore[attr-defined]  # it is a generator

    def __enter__(self) -> McapSource:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


@dataclass
class _Look:
    """The first reading of a log: what is worth knowing before its frames are given out."""

    path: Path
    topic: McapTopic
    summary: McapSummary
    clock: ClockCheck = field(default_factory=ClockCheck)
    size: tuple[int, int] | None = None
    encoding: str = ""
    frames: int = 0
    camera: Camera | None = None
    fault: str = ""
    camera_fault: str = ""

    def __post_init__(self) -> None:
        calibration = self.summary.camera_topic_of(self.topic.name)
        self.camera_topic = calibration.name if calibration else None
        decoder = PictureDecoder()
        reader = LogReader(self.path)
        for event in reader.read({self.topic.name} | ({self.camera_topic} if self.camera_topic else set())):
            if isinstance(event, LostChunk):
                for _ in lost_times(event, reader, self.topic.name):
                    self._picture(decoder.lose(self.frames, event.reason))
                    self.frames += 1
            elif event.channel.topic == self.topic.name:
                self._image(event, reader.schemas, decoder)
            elif self.camera is None:
                self._calibration(event, reader.schemas)
        self._picture(decoder.flush())
        if self.size is None:
            reason = f"not one of the {self.frames} messages of {self.topic.name} gives a picture"
            hint = "record the topic again, or choose another with --topic"
            raise InputError(f"{reason} ({self.fault or 'all are lost'})", file=self.path, hint=hint)

    def info(self) -> SourceInfo:
        """Return what was found as a SourceInfo."""
        assert self.size is not None
        times = self.clock.chosen
        return SourceInfo(
            path=self.path,
            kind="mcap",
            width=self.size[0],
            height=self.size[1],
            has_clock=True,
            frames_declared=max(self.topic.count, self.frames),
            duration_ns=times.highest_ns - times.lowest_ns,
            encoding=self.encoding,
            topic=self.topic.name,
            camera=self.camera,
            notes=(*self.clock.notes(self.topic.name), *self._camera_notes()),
        )

    def _image(self, event: LogMessage, schemas: dict[int, Schema], decoder: PictureDecoder) -> None:
        self.frames += 1
        try:
            message = _image_of(event, schemas)
        except BrokenMessageError as error:
            self.fault = self.fault or str(error)
            return
        self.clock.add(message.stamp_ns, event.log_time_ns)
        if self.size is None:
            self.encoding = message.encoding if isinstance(message, RawImage) else message.format
            self._picture(decoder.feed(self.frames - 1, message))

    def _picture(self, pictures: Iterable[Picture]) -> None:
        for picture in pictures:
            if picture.image is None:
                self.fault = self.fault or picture.damage
            elif self.size is None:
                self.size = picture.image.shape[1], picture.image.shape[0]

    def _calibration(self, event: LogMessage, schemas: dict[int, Schema]) -> None:
        try:
            parser = CALIBRATION_PARSERS[_type_of(event.channel, schemas)]
            calibration = parse_calibration(parser, event.data)
            self.camera = camera_from(calibration, rectified=is_rectified(self.topic.name))
        except (BrokenMessageError, InputError) as error:
            self.camera_fault = self.camera_fault or str(error)

    def _camera_notes(self) -> list[str]:
        if self.camera is not None:
            if is_rectified(self.topic.name):
                return [f"the pictures of {self.topic.name} are rectified, so the camera is {self.camera_topic}'s P"]
            return []
        if self.camera_topic is None:
            return [f"no calibration topic belongs to {self.topic.name}"]
        return [f"{self.camera_topic} gives no camera: {self.camera_fault or 'it has no messages'}"]


@dataclass
class _Pass:
    """One pass over the log."""

    path: Path
    topic: str
    clock: ClockCheck
    report: SourceReport
    times_ns: list[int | None] = field(default_factory=list)  # of the frames not given out yet, from `given` on
    given: int = 0
    size: tuple[int, ...] = ()

    def frames(self) -> Iterator[Frame | LostFrame]:
        """Yield the topic's frames. The file is open only while this runs."""
        reader, decoder = LogReader(self.path), PictureDecoder()
        for event in reader.read({self.topic}):
            if isinstance(event, LostChunk):
                self.report.note(event.reason)
                for log_time_ns in lost_times(event, reader, self.topic):
                    time_ns = log_time_ns if self.clock.fault else None  # the stamps went with the chunk
                    yield from self._give(decoder.lose(self._expect(time_ns), event.reason))
            else:
                yield from self._give(self._decode(event, reader.schemas, decoder))
        yield from self._give(decoder.flush())
        self.report.truncated = reader.truncated
        for note in reader.notes:
            self.report.note(note)

    def _decode(self, event: LogMessage, schemas: dict[int, Schema], decoder: PictureDecoder) -> list[Picture]:
        try:
            message = _image_of(event, schemas)
        except BrokenMessageError as error:
            number = self._expect(event.log_time_ns if self.clock.fault else None)
            return decoder.lose(number, str(error))
        return decoder.feed(self._expect(self.clock.t_ns(message.stamp_ns, event.log_time_ns)), message)

    def _expect(self, t_ns: int | None) -> int:
        """Return the number of the next frame and keep its time until it is given out."""
        self.times_ns.append(t_ns)
        return self.given + len(self.times_ns) - 1

    def _give(self, pictures: Iterable[Picture]) -> Iterator[Frame | LostFrame]:
        for picture in pictures:
            t_ns = self.times_ns.pop(0)
            self.given += 1
            if picture.image is None:
                self.report.lost += 1
                yield LostFrame(picture.number, t_ns, picture.damage)
                continue
            self.report.decoded += 1
            self.report.damaged += bool(picture.damage)
            size = picture.image.shape[:2]
            if self.size not in ((), size):
                self.report.note(f"the picture size changes to {size[1]}x{size[0]} on the way")
            self.size = size
            yield Frame(picture.number, t_ns, picture.image, damage=picture.damage)


def _type_of(channel: Channel, schemas: dict[int, Schema]) -> tuple[str, str]:
    schema = schemas.get(channel.schema_id)
    return plain_type(schema.name) if schema else "", channel.message_encoding


def _image_of(event: LogMessage, schemas: dict[int, Schema]) -> ImageMessage:
    kind = _type_of(event.channel, schemas)
    if kind not in IMAGE_PARSERS:
        raise BrokenMessageError(f"it is a '{kind[0]}' ({kind[1]}) among the images")
    return parse_image(IMAGE_PARSERS[kind], event.data)


def lost_times(lost: LostChunk, reader: LogReader, topic: str) -> Sequence[int | None]:
    """Return a time of logging for each message of a topic in a chunk; one unknown where nothing tells what it held."""
    if not lost.log_times_ns:
        return [None]
    mine = {number for number, channel in reader.channels.items() if channel.topic == topic}
    return sorted(time_ns for number, times in lost.log_times_ns.items() if number in mine for time_ns in times)
