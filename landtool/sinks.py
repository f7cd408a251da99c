"""Where results go: one visible table of sinks, and the loop that pulls results into them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2

from landtool.errors import OutputError, OutputExistsError, UsageError
from landtool.io.atomic import atomic_folder, atomic_path
from landtool.io.run_record import StageTime
from landtool.io.tables import TABLES, TableWriter
from landtool.io.video_out import VideoWriter
from landtool.plot_sink import PlotSink
from landtool.sink import ManagedSink, Sink, SinkSetup
from landtool.tum_sink import TumSink
from landtool.types import Frame, FrameResult, LostFrame

ANNOTATED_VIDEO = "annotated.mp4"
ANNOTATED_IMAGES = "annotated"
_JPEG_QUALITY = 95


class CsvSink(ManagedSink):
    """Writes the tables: one file each, a header even when there are no frames."""

    def _open(self, stack: ExitStack) -> None:
        for name in self._setup.tables:
            if name not in TABLES:
                raise UsageError(f"unknown table '{name}'", hint=f"known: {', '.join(TABLES)}")
        folder = self._setup.folder
        self._writers = [stack.enter_context(TableWriter(folder / name, TABLES[name])) for name in self._setup.tables]

    def write(self, frame: Frame | LostFrame, result: FrameResult) -> None:  # noqa: ARG002 - a table has no picture
        """Add the rows of one frame."""
        for writer in self._writers:
            writer.write(result)


class VideoSink(ManagedSink):
    """Writes annotated.mp4 with the source's own timing. No pictures, no file; a lost frame leaves a gap in time."""

    def _open(self, stack: ExitStack) -> None:
        self._path = self._setup.folder / ANNOTATED_VIDEO
        if self._path.exists():
            raise OutputExistsError(self._path)
        self._writer: VideoWriter | None = None
        stack.callback(self._take_notes)

    def write(self, frame: Frame | LostFrame, result: FrameResult) -> None:
        """Draw one frame and encode it. Raises UsageError for a frame without a time."""
        if isinstance(frame, LostFrame):
            return
        if frame.t_ns is None:
            reason = f"frame {frame.index} has no time, a video cannot be made"
            raise UsageError(reason, file=frame.file or None, hint="give the clock with --fps")
        if self._writer is None:
            self._writer = self._start(*frame.image.shape[1::-1])
        image = self._setup.drawn.of(frame, result)
        self._writer.write(image, frame.t_ns)

    def _start(self, width: int, height: int) -> VideoWriter:
        temporary = self._stack.enter_context(atomic_path(self._path))
        return self._stack.enter_context(VideoWriter(temporary, width, height, self._setup.time_base, quick=True))

    def _take_notes(self) -> None:
        if self._writer is not None:
            self.notes += self._writer.notes


class ImagesSink(ManagedSink):
    """Writes annotated pictures into the folder annotated/, under the names of the input's."""

    def _open(self, stack: ExitStack) -> None:
        self._folder = stack.enter_context(atomic_folder(self._setup.folder / ANNOTATED_IMAGES))

    def write(self, frame: Frame | LostFrame, result: FrameResult) -> None:
        """Draw one frame and save it; a kind of image that cannot be written becomes a PNG."""
        if isinstance(frame, LostFrame):
            return
        image = self._setup.drawn.of(frame, result)
        name = frame.file or f"{frame.index:06d}.png"
        kind = Path(name).suffix
        # by suffix alone: OpenCV crashes on a name that is no UTF-8
        if not (kind.isascii() and cv2.haveImageWriter(f"name{kind}")):
            self.notes.append(f"{name}: annotated as PNG, its own kind cannot be written")
            kind = ".png"
            name += kind
        path = self._folder / name
        # given to another kind of image, OpenCV warns on stderr for every picture
        options = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY] if kind.lower() in (".jpg", ".jpeg") else []
        done, data = cv2.imencode(kind, image, options)
        if not done:
            raise OutputError("cannot be encoded", file=self._setup.folder / ANNOTATED_IMAGES / name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data.tobytes())


def _pictures(setup: SinkSetup) -> Sink:
    return VideoSink(setup) if setup.has_clock else ImagesSink(setup)


def _results_log(setup: SinkSetup) -> Sink:
    from landtool.results_log.sink import McapSink  # loads mcap and protobuf

    return McapSink(setup)


# What --save chooses from
SINKS: dict[str, Callable[[SinkSetup], Sink]] = {
    "video": _pictures,
    "csv": CsvSink,
    "mcap": _results_log,
    "tum": TumSink,
    "plot": PlotSink,
}


@contextmanager
def open_sinks(names: Iterable[str], setup: SinkSetup) -> Iterator[list[Sink]]:
    """Open the sinks called `names` (of `SINKS`); all are closed at the end, and take back everything on failure.

    Raises UsageError for an unknown name, OutputExistsError for an output that is there already.
    """
    chosen = list(dict.fromkeys(names))
    for name in chosen:
        if name not in SINKS:
            raise UsageError(f"unknown output '{name}'", hint=f"known: {', '.join(SINKS)}")
    with ExitStack() as stack:
        yield [stack.enter_context(SINKS[name](setup)) for name in chosen]


@dataclass(frozen=True)
class Written:
    """What `write_all` passed on: frames (lost ones counted), pictures among them, and the time each stage took."""

    frames: int
    pictures: int
    timings: dict[str, StageTime]


def write_all(
    results: Iterable[tuple[Frame | LostFrame, FrameResult]],
    sinks: Sequence[Sink],
    on_frame: Callable[[Frame | LostFrame, FrameResult], None] | None = None,
) -> Written:
    """Pull every result, pass it to all sinks, then call `on_frame`; the sinks' own time is the stage "write"."""
    frames = pictures = 0
    timings: dict[str, StageTime] = {}
    for frame, result in results:
        start = time.perf_counter()
        for sink in sinks:
            sink.write(frame, result)
        spent = {**result.stage_seconds, "write": time.perf_counter() - start}
        for stage, seconds in spent.items():
            timings[stage] = timings.get(stage, StageTime()).add(seconds)
        frames += 1
        pictures += isinstance(frame, Frame)
        if on_frame is not None:
            on_frame(frame, result)
    return Written(frames, pictures, timings)
