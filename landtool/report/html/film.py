"""The annotated video of a run in the page: embedded, linked, or a word on why there is none."""

from __future__ import annotations

import base64
import os
from bisect import bisect_right
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from urllib.parse import quote

from landtool.errors import LandtoolError
from landtool.io.video_stills import VideoTimes, read_stills, read_times
from landtool.report.html.flight import Flight

NS = 1_000_000_000
VideoMode = Literal["auto", "embed", "link", "none"]
VIDEO_MODES: tuple[VideoMode, ...] = ("auto", "embed", "link", "none")
EMBED_BYTES = 25_000_000  # of all videos of a page: what a mail and a phone still take
STILL_PX = 320


@dataclass
class Budget:
    """How many bytes of video `auto` may still put into the page."""

    left: int = EMBED_BYTES


@dataclass(frozen=True)
class Film:
    """A run's video. data: base64, empty where it is not embedded. url: relative, empty where it is not linked.

    said: what there is, or why there is none. times: None where the file cannot be read. shown_s: when the player shows
    each frame of the flight, on the file's own clock, which may begin later than 0; None where nothing can be sought.
    """

    said: str
    data: str = ""
    url: str = ""
    path: Path | None = None
    times: VideoTimes | None = None
    shown_s: tuple[float, ...] | None = None

    @property
    def plays(self) -> bool:
        """Whether the page has a player."""
        return bool(self.data or self.url)


def film(path: Path | None, flight: Flight, output: Path, mode: VideoMode, budget: Budget, *, without: str) -> Film:
    """Return how a run's video is to be shown; what is wrong with the file is said in it.

    without: why there is none, said where `path` is None.
    """
    if path is None:
        return Film(f"No video: {without}.")
    try:
        times = read_times(path)
    except LandtoolError as error:
        return Film(f"No video: {path.name} cannot be used: {error.reason}.")
    if not times.t_ns:
        return Film(f"No video: {path.name} shows no picture.")
    shown_s = _shown_s(flight, times)
    if mode == "none":
        return Film("No video, as was asked for with --video none.", path=path, times=times, shown_s=shown_s)
    size = path.stat().st_size
    if mode == "embed" or (mode == "auto" and size <= budget.left):
        budget.left -= size
        data = base64.b64encode(path.read_bytes()).decode("ascii")
        return Film(f"Embedded, {size / 1e6:.1f} MB.", data, "", path, times, shown_s)
    said = f"Linked, {size / 1e6:.1f} MB: {path.name} has to stay where it is, seen from this page."
    return Film(said, "", _relative_url(path, output), path, times, shown_s)


def stills(made: Film, frames: list[int]) -> list[str]:
    """Return pictures of frames of the flight, by place in it, as base64 JPEGs; "" where there is none."""
    if made.path is None or made.times is None or made.shown_s is None:
        return [""] * len(frames)
    wanted = [_at(made.times, round(made.shown_s[i] * NS)) for i in frames]
    try:
        found = read_stills(made.path, wanted, STILL_PX)
    except LandtoolError:
        return [""] * len(frames)
    return ["" if data is None else base64.b64encode(data).decode("ascii") for data in found]


def _at(times: VideoTimes, t_ns: int) -> int:
    """Return the time of the picture that is shown at a moment; a microsecond of rounding is no other picture."""
    return times.t_ns[max(0, bisect_right(times.t_ns, t_ns + 1000) - 1)]


def _shown_s(flight: Flight, times: VideoTimes) -> tuple[float, ...]:
    """Return for each frame when its picture is shown, on the video's clock in s; a lost one has that before it.

    A player counts by that clock, too: where the first picture comes later than 0, so does all of it.

    Where the video holds as many pictures as the flight they are the same ones, else they are found by their times.
    """
    start_ns = times.t_ns[0]
    pictures = iter(times.t_ns)
    in_order = sum(flight.has_picture) == len(times.t_ns)
    first_ns = next((t for t, has in zip(flight.t_ns, flight.has_picture, strict=True) if has and t is not None), 0)
    shown, last = [], start_ns
    for t_ns, has in zip(flight.t_ns, flight.has_picture, strict=True):
        if in_order and has:
            last = next(pictures)
        elif not in_order and t_ns is not None:
            last = _at(times, max(start_ns, t_ns - first_ns + start_ns))
        shown.append(last / NS)
    return tuple(shown)


def _relative_url(path: Path, output: Path) -> str:
    relative = os.path.relpath(os.path.realpath(path), os.path.realpath(output.parent))
    return quote(Path(relative).as_posix(), errors="surrogateescape")
