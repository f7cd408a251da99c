"""What dehazed frames are written to: one output a kind of recording, and the transmission maps beside it."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

import numpy as np

from landtool.dehaze.stage import Dehazed
from landtool.errors import UsageError
from landtool.io.atomic import atomic_folder, atomic_path
from landtool.io.image_out import IMAGE_FORMATS, encode_image, encode_share, image_form
from landtool.io.managed import Managed
from landtool.io.mcap_copy import McapCopy
from landtool.io.source import SourceInfo, SourceKind
from landtool.io.video_out import VideoWriter
from landtool.types import Frame, Image, LostFrame


@dataclass(frozen=True)
class OutputSetup:
    """What an output is made from. names: of the pictures that will be written, where they are known before."""

    info: SourceInfo
    path: Path
    overwrite: bool = False
    side_by_side: bool = False
    names: frozenset[str] = frozenset()


class Output(Protocol):
    """Takes every frame in order with what the stage made of it, None for a lost one. Whole or not at all.

    `notes`: one sentence each.
    """

    @property
    def notes(self) -> list[str]:
        """What could not be kept."""
        ...

    @property
    def lossy(self) -> bool:
        """Whether more was lost than frames."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None
    ) -> None: ...

    def write(self, frame: Frame | LostFrame, seen: Dehazed | None) -> None:
        """Add one frame."""
        ...


class _Managed(Managed):
    """An output as a context."""

    def __init__(self, setup: OutputSetup) -> None:
        super().__init__()
        self._setup = setup

    @property
    def lossy(self) -> bool:
        """False: frames are counted elsewhere."""
        return False


class ImagesOutput(_Managed):
    """An image, or a folder of them under their own names. A file whose frame stays as it is, is copied."""

    def _open(self, stack: ExitStack) -> None:
        setup = self._setup
        self._single = not setup.info.path.is_dir()
        self._counts = dict.fromkeys(_DROPPED, 0)
        place = (
            atomic_path(setup.path, overwrite=setup.overwrite)
            if self._single
            else atomic_folder(setup.path, overwrite=setup.overwrite, mark=setup.names.issuperset)
        )
        self._place = stack.enter_context(place)

    @property
    def notes(self) -> list[str]:
        """What dehazed pictures could not keep."""
        return [f"{count} {text}" for text, count in self._counts.items() if count]

    def write(self, frame: Frame | LostFrame, seen: Dehazed | None) -> None:
        """Write one picture. Raises OutputError for one its format cannot hold."""
        if isinstance(frame, LostFrame) or seen is None:
            return
        source = self._setup.info.path if self._single else self._setup.info.path / frame.file
        target = self._place if self._single else self._place / frame.file
        data = source.read_bytes()
        form, suffix = image_form(data), target.suffix.lower()
        if not seen.dehazed and not self._setup.side_by_side and form.format == IMAGE_FORMATS[suffix]:
            target.write_bytes(data)
            return
        for text, dropped in zip(_DROPPED, (form.sixteen_bit, form.alpha), strict=True):
            self._counts[text] += dropped
        target.write_bytes(encode_image(_shown(frame, seen, self._setup), suffix, grey=form.grey))


_DROPPED = (
    "pictures of 16 bits a channel were written with 8",
    "pictures were written without their alpha channel",
)


class VideoOutput(_Managed):
    """H.264 with the source's own times; a lost frame leaves a gap."""

    def _open(self, stack: ExitStack) -> None:
        self._writer: VideoWriter | None = None
        place = atomic_path(self._setup.path, overwrite=self._setup.overwrite)
        self._temporary = stack.enter_context(place)

    @property
    def notes(self) -> list[str]:
        """What the video could not keep."""
        return [] if self._writer is None else self._writer.notes

    def write(self, frame: Frame | LostFrame, seen: Dehazed | None) -> None:
        """Encode one picture. Raises UsageError for one without a time."""
        if isinstance(frame, LostFrame) or seen is None:
            return
        if frame.t_ns is None:
            hint = "put it into an MP4 or MKV with its frame rate first"
            raise UsageError(f"frame {frame.index} has no time", file=self._setup.info.path, hint=hint)
        image = _shown(frame, seen, self._setup)
        if self._writer is None:
            height, width = image.shape[:2]
            writer = VideoWriter(self._temporary, width, height, self._setup.info.time_base)
            self._writer = self._stack.enter_context(writer)
        self._writer.write(image, frame.t_ns)


class McapOutput(_Managed):
    """The log with dehazed pictures on its image topic; messages without a picture, and all others, stay."""

    def _open(self, stack: ExitStack) -> None:
        if self._setup.side_by_side:
            reason = "pictures side by side would not fit the calibration in a log"
            raise UsageError(reason, file=self._setup.info.path, hint="leave out --side-by-side")
        info = self._setup.info
        temporary = stack.enter_context(atomic_path(self._setup.path, overwrite=self._setup.overwrite))
        self._copy = stack.enter_context(McapCopy(info.path, temporary, info.topic))

    @property
    def notes(self) -> list[str]:
        """What the log could not keep."""
        return self._copy.notes

    @property
    def lossy(self) -> bool:
        """Whether parts of the log, of any topic, are lost."""
        return self._copy.lost_chunks > 0

    def write(self, frame: Frame | LostFrame, seen: Dehazed | None) -> None:
        """Copy the log up to this frame."""
        if isinstance(frame, LostFrame) or seen is None:
            self._copy.skip()
        else:
            self._copy.write(seen.image, changed=seen.dehazed)


class MapsOutput(_Managed):
    """The transmission of each dehazed frame, full size, as a grey PNG of 16 bits: 65535 is 1.

    Maps of a folder's or a single image have its name, those of a video or log the frame's number.
    """

    notes: list[str] = []  # noqa: RUF012 - a map keeps all there is

    def _open(self, stack: ExitStack) -> None:
        setup = self._setup
        names = {name for image in setup.names for name in _map_names(image)}
        place = atomic_folder(
            setup.path,
            overwrite=setup.overwrite,
            mark=lambda found: all(name in names or re.fullmatch(r"\d{6,}\.png", name) for name in found),
        )
        self._folder = stack.enter_context(place)

    def write(self, frame: Frame | LostFrame, seen: Dehazed | None) -> None:
        """Write one map."""
        if isinstance(frame, LostFrame) or seen is None or seen.transmission is None:
            return
        short, full = _map_names(frame.file) if frame.file else [f"{frame.index:06d}.png"] * 2
        # two images may differ in their endings only
        path = self._folder / (full if (self._folder / short).exists() else short)
        height, width = frame.image.shape[:2]
        path.write_bytes(encode_share(seen.transmission, width, height))


OUTPUTS: dict[SourceKind, Callable[[OutputSetup], Output]] = {
    "images": ImagesOutput,
    "video": VideoOutput,
    "mcap": McapOutput,
}


def _map_names(image: str) -> list[str]:
    """Return what an image's map is called, and what when that is taken."""
    return [f"{Path(image).stem}.png", f"{image}.png"]


def _shown(frame: Frame, seen: Dehazed, setup: OutputSetup) -> Image:
    """Return the picture to write: the stage's, with the input's to its left when both are wanted."""
    return np.hstack([frame.image, seen.image]) if setup.side_by_side else seen.image
