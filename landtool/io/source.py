"""What a source of frames is, and how one is opened: the kind is told by content, never by the file's name."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Literal, NamedTuple, Protocol

from landtool.camera import Camera
from landtool.errors import InputError, UsageError
from landtool.io.local import local_path
from landtool.types import Frame, LostFrame

SourceKind = Literal["video", "images", "mcap"]
HEAD_BYTES = 4096
MCAP_MAGIC = b"\x89MCAP0\r\n"
PLAYLIST_STARTS = (b"#EXTM3U", b"ffconcat", b"<MPD", b"<SmoothStreamingMedia", b"v=0\r\n", b"v=0\no=", b"[playlist]")
PLAYLIST_SUFFIXES = (".m3u8", ".m3u", ".mpd", ".ffconcat", ".pls", ".sdp", ".ism")
IMAGE_STARTS = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"II*\x00", b"MM\x00*")


@dataclass(frozen=True)
class SourceInfo:
    """What is known of a source before its frames are read.

    width, height: pixels of the first picture as it is given out, rotation applied. has_clock: frames carry t_ns.
    frames_declared: what the container says, which may be wrong; None when it says nothing. time_base: seconds a tick,
    None for a clock in nanoseconds (MCAP) or none. rotation_deg: the turn already applied to the pictures, degrees
    clockwise, a multiple of 90; the camera's intrinsics need the same, `quarter_turns`. encoding: codec or message
    encoding. camera: what an MCAP itself carries. notes: anything the user should hear about, one sentence each.
    """

    path: Path
    kind: SourceKind
    width: int
    height: int
    has_clock: bool
    frames_declared: int | None
    duration_ns: int | None
    encoding: str
    time_base: Fraction | None = None
    rotation_deg: int = 0
    topic: str = ""
    camera: Camera | None = None
    notes: tuple[str, ...] = ()

    @property
    def quarter_turns(self) -> int:
        """Quarter turns clockwise, 0 to 3, that were applied to the pictures."""
        return self.rotation_deg // 90 % 4


@dataclass
class SourceReport:
    """What one pass over a source met so far. Reset at the start of every pass, readable at any time.

    decoded: pictures given out, those with damage included. damaged: pictures given out with damage. lost: frames
    no picture could be got from. skipped: what the container itself says not to show (pre-roll, edited out).
    truncated: the data ends before the container says it should.
    """

    declared: int | None = None
    decoded: int = 0
    damaged: int = 0
    lost: int = 0
    skipped: int = 0
    truncated: bool = False
    notes: list[str] = field(default_factory=list)

    @property
    def complete(self) -> bool:
        """True while nothing was lost, damaged or cut off."""
        return not (self.damaged or self.lost or self.truncated)

    def note(self, text: str) -> None:
        """Add a sentence once, however often it is said."""
        if text not in self.notes:
            self.notes.append(text)


class Source(Protocol):
    """Frames in presentation order. Indices run 0, 1, 2 ... without gaps, lost frames counted.

    Every `iter()` starts a fresh pass from the first frame, with a fresh `report`; abandoning one releases what it
    held. One pass at a time.
    """

    @property
    def info(self) -> SourceInfo:
        """What is known before reading."""
        ...

    @property
    def report(self) -> SourceReport:
        """What the current (or last) pass met so far."""
        ...

    def __iter__(self) -> Iterator[Frame | LostFrame]: ...

    def close(self) -> None:
        """Release everything; may be called again."""
        ...

    def __enter__(self) -> Source: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


def open_source(path: Path | str, *, topic: str | None = None, fps: Fraction | float | None = None) -> Source:
    """Open a local video file, folder of images, single image or MCAP log, told apart by content.

    topic: which image topic of an MCAP. fps: gives a folder of images a clock; nothing else takes it.
    Raises UsageError for what is no plain local file or folder and for an option the kind does not take,
    InputError for content that cannot be read.
    """
    path = local_path(path)
    kind = _kind(path)
    if topic is not None and kind.name != "mcap":
        raise UsageError("has no topics, only an MCAP log has", file=path, hint="leave out --topic")
    if fps is not None and kind.name != "images":
        raise UsageError("has its own clock", file=path, hint="leave out --fps, it is for folders of images")
    if fps is not None and not 0 < fps < math.inf:
        raise UsageError(f"cannot have {fps} pictures a second", file=path, hint="give --fps above 0")
    # by its text: 29.97 is 2997/100, not the binary fraction next to it
    return kind.open(path, topic, None if fps is None else Fraction(str(fps)))


def kind_of(path: Path | str) -> SourceKind:
    """Tell which kind of source a path is, without opening it. Raises as `open_source` does for what is none."""
    return _kind(local_path(path)).name


def _kind(path: Path) -> Kind:
    head = b"" if path.is_dir() else _head(path)
    return next(kind for kind in KINDS if kind.recognises(path, head))


def _open_images(path: Path, _topic: str | None, fps: Fraction | None) -> Source:
    from landtool.io.images import ImageFolderSource

    return ImageFolderSource(path, fps=fps)


def _open_mcap(path: Path, topic: str | None, _fps: Fraction | None) -> Source:
    from landtool.io.mcap import McapSource

    return McapSource(path, topic=topic)


def _open_video(path: Path, _topic: str | None, _fps: Fraction | None) -> Source:
    from landtool.io.video import VideoSource

    return VideoSource(path)


def _is_image(path: Path, head: bytes) -> bool:
    webp = head[:4] == b"RIFF" and head[8:12] == b"WEBP"
    bmp = head[:2] == b"BM" and head[6:10] == bytes(4)
    return path.is_dir() or head.startswith(IMAGE_STARTS) or webp or bmp


class Kind(NamedTuple):
    """A kind of source: its name, a test of (path, first bytes), and its opener of (path, topic, fps)."""

    name: SourceKind
    recognises: Callable[[Path, bytes], bool]
    open: Callable[[Path, str | None, Fraction | None], Source]


# The first that recognises the content opens it; FFmpeg's own probing decides about all the rest.
KINDS: tuple[Kind, ...] = (
    Kind("images", _is_image, _open_images),
    Kind("mcap", lambda _path, head: head.startswith(MCAP_MAGIC), _open_mcap),
    Kind("video", lambda _path, _head: True, _open_video),
)


def _head(path: Path) -> bytes:
    """Return the first bytes of a file that may be a recording; raise for an empty file or a playlist."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=path, hint="check its permissions") from None
    if not head:
        raise InputError("is empty", file=path, hint="record or copy it again")
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    # An XML prolog may come before a DASH manifest's root.
    playlist = text.startswith(PLAYLIST_STARTS) or (text.startswith(b"<?xml") and b"<MPD" in text)
    if playlist or path.suffix.lower() in PLAYLIST_SUFFIXES:
        raise UsageError("is a playlist, not a recording", file=path, hint="give the recording it points to")
    return head
