"""What a sink is, and what it is made from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from landtool.camera import Camera
from landtool.draw import Overlay
from landtool.geometry import Pose
from landtool.io.managed import Managed
from landtool.io.tables import TABLES
from landtool.pad import PadSpec
from landtool.types import Frame, FrameResult, Image, LostFrame

CameraFromReference = Callable[[FrameResult], Pose | None]


class DrawnPictures:
    """Annotated pictures, each drawn once however many sinks want it; all sinks get a frame before the next one."""

    def __init__(self, overlay: Overlay, camera_T_reference: CameraFromReference) -> None:
        self._overlay, self._camera_T_reference = overlay, camera_T_reference
        self._last: tuple[Frame, Image] | None = None

    def of(self, frame: Frame, result: FrameResult) -> Image:
        """Return the frame's picture (H, W, 3) BGR with the result drawn over it; not to be written to."""
        if self._last is None or self._last[0] is not frame:
            self._last = frame, self._overlay.draw(frame, result, self._camera_T_reference(result))
        return self._last[1]


@dataclass(frozen=True)
class SinkSetup:
    """What sinks are made from.

    folder: where they write; an output that is there already is refused. recording: the input, for what is said of it.
    tables: which tables, names of `io.tables.TABLES`. overlay: draws the pictures. has_clock: whether frames carry
    times; without, pictures are written one by one. time_base: the video's own, seconds a tick, None where the source
    has none.
    camera_T_reference: the pose of the tracks' reference frame in the camera at a frame, None where it is not known.
    camera, pad, body_T_camera: of the recording, None where they are not known. provenance: what a file that leaves its
    folder says of its making, as texts by name; asked for at the end of the run. nis_dof: numbers a measurement of the
    filter has, 2 or 4.
    """

    folder: Path
    tables: tuple[str, ...] = tuple(TABLES)
    overlay: Overlay = field(default_factory=Overlay)
    has_clock: bool = True
    time_base: Fraction | None = None
    camera_T_reference: CameraFromReference = lambda _result: None
    camera: Camera | None = None
    pad: PadSpec | None = None
    body_T_camera: Pose | None = None
    provenance: Callable[[], Mapping[str, str]] = dict
    recording: Path | None = None
    nis_dof: int = 2

    @cached_property
    def drawn(self) -> DrawnPictures:
        """The annotated pictures, shared by all sinks of one run."""
        return DrawnPictures(self.overlay, self.camera_T_reference)


class Sink(Protocol):
    """Takes frames in order and writes them whole or not at all: outputs appear when the context ends well.

    `notes` says, one sentence each, what could not be kept.
    """

    notes: list[str]

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None
    ) -> None: ...

    def write(self, frame: Frame | LostFrame, result: FrameResult) -> None:
        """Add one frame; its picture when there is one."""
        ...


class ManagedSink(Managed):
    """A sink as a context."""

    def __init__(self, setup: SinkSetup) -> None:
        super().__init__()
        self.notes: list[str] = []
        self._setup = setup
