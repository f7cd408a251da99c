"""Folders of images, and single images, as a source: natural order of names, no clock unless a rate is given."""

from __future__ import annotations

import re
import warnings
from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from types import TracebackType

import numpy as np
from PIL import Image as PilImage
from PIL import ImageOps, UnidentifiedImageError

from landtool.errors import InputError
from landtool.io.damage import is_zeroed
from landtool.io.source import SourceInfo, SourceReport
from landtool.types import Frame, Image, LostFrame

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff")
RECORDING_SUFFIXES = (".mcap", ".mp4", ".mov", ".mkv", ".webm", ".avi", ".ts")
FORMATS = ("PNG", "JPEG", "BMP", "WEBP", "TIFF")  # Pillow reads many more, some through other programs
MAX_PIXELS = 80_000_000  # 240 MB as BGR; a file of a few kB can claim far more
NS = 1_000_000_000
ORIENTATION_TAG = 0x0112
# EXIF orientation to degrees clockwise that make the picture upright; the mirrored ones are in MIRRORED.
TURNS = {3: 180, 4: 180, 5: 90, 6: 90, 7: 270, 8: 270}
MIRRORED = (2, 4, 5, 7)


@dataclass(frozen=True, eq=False)
class Picture:
    """One decoded image file. image: (H, W, 3) BGR uint8, upright. encoding: the format's name, lower case.

    damage: what is wrong with it although it was decoded, else empty.
    """

    image: Image
    encoding: str
    rotation_deg: int
    mirrored: bool
    damage: str = ""


class PictureError(Exception):
    """An image file no picture can be got from; the text says why."""


class ImageFolderSource:
    """A folder of images, or one image file, as a `Source`.

    Files are taken by suffix (png, jpeg, bmp, webp, tiff), hidden ones and subfolders left out. EXIF orientation is
    applied, 16 bits scaled to 8, grey and palettes become BGR, alpha is ignored. A file no picture can be got from is
    a LostFrame with its name. fps: pictures a second; without it the frames have no time.
    Raises InputError when the folder holds no image, or none that can be decoded.
    """

    def __init__(self, path: Path, fps: Fraction | None = None) -> None:
        self.path = Path(path)
        self.fps = fps
        self.files, ignored = ([self.path], 0) if self.path.is_file() else _image_files(self.path)
        self._notes = [f"left out, as they are no images: {ignored}"] if ignored else []
        self.report = SourceReport()
        self._passes: list[Generator[Frame | LostFrame, None, None]] = []
        self.info = self._describe()

    def __iter__(self) -> Iterator[Frame | LostFrame]:
        self.close()
        self.report = SourceReport(declared=len(self.files), notes=list(self.info.notes))
        frames = self._frames(self.report)
        self._passes.append(frames)
        return frames

    def close(self) -> None:
        """End the pass under way, if any."""
        while self._passes:
            self._passes.pop().close()

    def __enter__(self) -> ImageFolderSource:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _frames(self, report: SourceReport) -> Generator[Frame | LostFrame, None, None]:
        for index, file in enumerate(self.files):
            t_ns = None if self.fps is None else round(index * NS / self.fps)
            try:
                picture = read_picture(file)
            except PictureError as error:
                report.lost += 1
                yield LostFrame(index, t_ns, str(error), file=file.name)
                continue
            report.decoded += 1
            report.damaged += bool(picture.damage)
            if picture.rotation_deg != self.info.rotation_deg:
                report.note("the images are not all turned the same way; the camera's intrinsics fit only some")
            yield Frame(index, t_ns, picture.image, file=file.name, damage=picture.damage)

    def _describe(self) -> SourceInfo:
        picture = self._first()
        if picture.mirrored:
            self._notes.append("the images were stored mirrored and were mirrored back")
        height, width = picture.image.shape[:2]
        return SourceInfo(
            path=self.path,
            kind="images",
            width=width,
            height=height,
            has_clock=self.fps is not None,
            frames_declared=len(self.files),
            duration_ns=None if self.fps is None else round(len(self.files) * NS / self.fps),
            encoding=picture.encoding,
            time_base=None if self.fps is None else 1 / self.fps,
            rotation_deg=picture.rotation_deg,
            notes=tuple(self._notes),
        )

    def _first(self) -> Picture:
        reason = ""
        for file in self.files:
            try:
                return read_picture(file)
            except PictureError as error:
                reason = reason or f"{error} ({file.name})"
        if self.path.is_file():
            raise InputError(reason.removesuffix(f" ({self.path.name})"), file=self.path, hint="copy it again")
        raise InputError(f"holds no image that can be decoded: {reason}", file=self.path, hint="copy it again")


def natural_key(name: str) -> tuple[list[tuple[int, int | str]], str]:
    """Sort key that puts img2 before img10: numbers by value, the rest without regard to case."""
    # re.split with a group alternates text and digits, so equal places always compare alike.
    parts = re.split(r"([0-9]+)", name.casefold())
    return [(1, int(part)) if place % 2 else (0, part) for place, part in enumerate(parts)], name


def read_picture(path: Path) -> Picture:
    """Decode one image file. Raises PictureError when that cannot be done whole."""
    try:
        data = path.read_bytes()
        if not data:
            raise PictureError("is empty")
        with warnings.catch_warnings():
            # Pillow warns on stderr about large images; the limit below speaks for itself.
            warnings.simplefilter("ignore", PilImage.DecompressionBombWarning)
            with PilImage.open(BytesIO(data), formats=FORMATS) as stored:
                return replace(_decode(stored), damage=_damage(data, stored.format))
    except UnidentifiedImageError:
        raise PictureError("is no image that can be read") from None
    except PilImage.DecompressionBombError:
        raise PictureError(f"has more than the limit of {MAX_PIXELS // 1_000_000} megapixels") from None
    except (OSError, ValueError, SyntaxError, EOFError, MemoryError) as error:  # Pillow's decoders raise all of these
        text = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise PictureError(f"cannot be decoded ({text})") from None


def _damage(data: bytes, kind: str | None) -> str:
    zeroed = kind in ("JPEG", "MPO") and is_zeroed(data, jpeg=True)
    return "part of its data is zeroed" if zeroed else ""


def _decode(stored: PilImage.Image) -> Picture:
    width, height = stored.size
    if width * height > MAX_PIXELS:
        megapixels = MAX_PIXELS // 1_000_000
        raise PictureError(f"has {width}x{height} pixels, more than the limit of {megapixels} megapixels")
    orientation = stored.getexif().get(ORIENTATION_TAG, 1)
    upright = ImageOps.exif_transpose(stored)
    encoding = (stored.format or "").lower()
    return Picture(_to_bgr(upright), encoding, TURNS.get(orientation, 0), orientation in MIRRORED)


def _to_bgr(picture: PilImage.Image) -> Image:
    if picture.mode == "F":
        raise PictureError("holds floating-point values, which have no agreed range")
    if picture.mode.startswith("I"):  # grey of 16 bits; Pillow's own conversion clips it
        deep = np.asarray(picture).astype(np.int64)
        if deep.min() < 0 or deep.max() > 65535:
            raise PictureError("holds grey values of more than 16 bits")
        grey = ((deep + 128) // 257).astype(np.uint8)
        return np.repeat(grey[:, :, None], 3, axis=2)
    # A palette with transparency must go by way of RGBA; alpha itself is dropped, not composed.
    if picture.mode == "P":
        picture = picture.convert("RGBA")
    rgb = np.asarray(picture.convert("RGB"), np.uint8)
    return np.ascontiguousarray(rgb[:, :, ::-1])


def _image_files(folder: Path) -> tuple[list[Path], int]:
    """Images of a folder in natural order, and how many entries are something else."""
    try:
        entries = [entry for entry in folder.iterdir() if not entry.name.startswith(".")]
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", file=folder, hint="check its permissions") from None
    files = [entry for entry in entries if entry.suffix.lower() in SUFFIXES and entry.is_file()]
    if not files:
        recording = next((e for e in sorted(entries) if e.suffix.lower() in RECORDING_SUFFIXES and e.is_file()), None)
        hint = f"give a folder that holds images itself ({', '.join(SUFFIXES)})"
        hint = f"give the recording in it: {recording}" if recording else hint
        raise InputError("holds no images" if entries else "is an empty folder", file=folder, hint=hint)
    return sorted(files, key=lambda file: natural_key(file.name)), len(entries) - len(files)
