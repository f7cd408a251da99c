"""Errors of tags against the truth: their corners, whether legible ones were read, and the pose of a tag alone."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from landtool.camera import Camera
from landtool.evaluate.bootstrap import UNDEFINED, Estimate, Resamples
from landtool.evaluate.clip_truth import ClipTruth, tilt_deg
from landtool.evaluate.columns import Chosen, column, flags, over_parts
from landtool.evaluate.metric import Metric, metric
from landtool.evaluate.pose_difference import mirrored, pose_difference
from landtool.evaluate.pose_errors import unit
from landtool.evaluate.true_pad import VISIBLE, TruePad
from landtool.geometry import Array
from landtool.io.tables import Columns, Row
from landtool.pad import PadSpec, PadTag
from landtool.tags.pose import pad_corners, pad_solutions
from landtool.types import FrameResult, TagObservation

LEGIBLE_PX = 14.0  # of a tag's shortest side: two pixels a module less the blur, the least a reader is asked to read
PARTS = ("distance_m", "tilt_deg", "tag_px")
TAG_ERROR_COLUMNS: Columns = {
    "model": str,
    "clip": str,
    "frame": int,
    "read": int,
    **dict.fromkeys(("tag_px", "distance_m", "tilt_deg", "corner_px", "place_m", "normal_deg"), float),
    "flipped": int,
    "tag_id": int,
}
"""The columns of tag_errors.csv."""


@dataclass(frozen=True)
class TagError:
    """One true tag that was read or is legible, or a reading that is of no true tag; None is not known.

    clip: the clip's name, of a still its path. tag_px: its shortest side as the picture shows it. legible: 14 px or
    more, all of it in the picture and nothing in front of it. wrong: it is no tag of the pad, or not where that tag is.
    corner_px: RMS over the four corners. place_m, normal_deg, flipped: of the pose of this tag alone, the solution that
    fits better.
    """

    clip: str
    frame: int
    t_ns: int | None
    tag_id: int
    read: bool
    legible: bool = False
    wrong: bool = False
    tag_px: float | None = None
    distance_m: float | None = None
    tilt_deg: float | None = None
    corner_px: float | None = None
    place_m: float | None = None
    normal_deg: float | None = None
    flipped: bool | None = None

    @property
    def unit(self) -> Hashable:
        """What it is resampled with: the same second of a clip."""
        return unit(self.clip, self.frame, self.t_ns)


def tag_errors(
    clip: str, results: Sequence[FrameResult], truth: ClipTruth, camera: Camera, pad: PadSpec
) -> list[TagError]:
    """Return the rows of all frames of a clip with a true pose."""
    rows: list[TagError] = []
    for result in results:
        frame = truth.at(result.index, result.t_ns)
        true = None if frame is None else frame.pad(camera)
        if true is not None:
            rows += picture_tag_errors(clip, result, true, pad)
    return rows


def still_tag_errors(pictures: Iterable[tuple[str, FrameResult, TruePad]], pad: PadSpec) -> list[TagError]:
    """Return the rows of single pictures: their paths, what was found, what is true."""
    return [row for path, result, true in pictures for row in picture_tag_errors(path, result, true, pad)]


def picture_tag_errors(clip: str, result: FrameResult, true: TruePad, pad: PadSpec) -> Iterator[TagError]:
    """Yield the rows of one picture: every tag of the pad that was read or is legible, then what was misread."""
    left = list(result.tags)
    for tag in pad.tags:
        corners = _true_corners(tag, true, pad)
        blank = TagError(clip, result.index, result.t_ns, tag.id, read=False)
        row = _geometry(blank, tag, true, pad, corners)
        found = _taken(left, tag, corners)
        if found is not None:
            yield _read(row, found, tag, true, pad, corners)
        elif row.legible:
            yield row
    for reading in left:
        yield TagError(clip, result.index, result.t_ns, reading.tag_id, read=True, wrong=True)


def _true_corners(tag: PadTag, true: TruePad, pad: PadSpec) -> Array:
    """Return where the picture shows the corners (4, 2), NaN where it cannot."""
    # the truth knows those of the first tag with the rolling shutter; the others are where a still camera has them
    if tag == pad.tags[0] and true.tag_corners_px is not None:
        return true.tag_corners_px
    return true.camera.project(true.camera_T_pad.apply(pad.tag_corners_m(tag)))


def _geometry(row: TagError, tag: PadTag, true: TruePad, pad: PadSpec, corners: Array) -> TagError:
    camera_T_tag = true.camera_T_pad @ pad.pad_T_tag(tag)
    row = replace(row, distance_m=float(np.linalg.norm(camera_T_tag.translation)), tilt_deg=tilt_deg(camera_T_tag))
    if not np.isfinite(corners).all():
        return row
    side_px = float(_sides_px(corners).min())
    return replace(row, tag_px=side_px, legible=side_px >= LEGIBLE_PX and _clear(corners, true))


def _clear(corners: Array, true: TruePad) -> bool:
    """Whether all of a tag is in the picture and, as far as anyone knows, nothing in front of it."""
    edges = np.array([true.camera.width, true.camera.height]) - 0.5
    inside = bool(((corners >= -0.5) & (corners <= edges)).all())
    if true.hidden is not None:
        return inside and true.hidden == 0.0
    return inside and (true.visible_fraction is None or true.visible_fraction > VISIBLE)


def _sides_px(corners: Array) -> Array:
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1))


def _taken(left: list[TagObservation], tag: PadTag, corners: Array) -> TagObservation | None:
    """Take the reading of a tag out of the list: the nearest of its number that is nearer than the tag is long."""
    same = [reading for reading in left if (reading.family, reading.tag_id) == (tag.family, tag.id)]
    if not same or not np.isfinite(corners).all():
        return None
    best = min(same, key=lambda reading: _rms_px(reading, corners))
    centre_off = np.linalg.norm(best.corners_px.mean(axis=0) - corners.mean(axis=0))
    if centre_off > _sides_px(corners).max():
        return None
    left.remove(best)
    return best


def _rms_px(reading: TagObservation, corners: Array) -> float:
    return float(np.sqrt(((reading.corners_px - corners) ** 2).sum(axis=1).mean()))


def _read(row: TagError, reading: TagObservation, tag: PadTag, true: TruePad, pad: PadSpec, corners: Array) -> TagError:
    row = replace(row, read=True, corner_px=_rms_px(reading, corners))
    gathered = pad_corners([reading], true.camera, pad)
    solutions = () if gathered is None else pad_solutions(gathered)
    if not solutions:
        return row
    pad_T_tag = pad.pad_T_tag(tag)
    found, truly = solutions[0].camera_T_pad @ pad_T_tag, true.camera_T_pad @ pad_T_tag
    off = pose_difference(found, truly)
    return replace(row, place_m=off.place_m, normal_deg=off.normal_deg, flipped=mirrored(found, truly))


def tag_metrics(errors: Sequence[TagError]) -> list[Metric]:
    """Return the metrics of tags. read_share: of the legible ones. wrong_ids: how many readings are of no true tag.

    The others are of all that were read right; poses are those of one tag alone, flip_share is how many are mirrored.
    """
    resamples = Resamples([error.unit for error in errors])
    read, legible, wrong = (flags(errors, name) for name in ("read", "legible", "wrong"))
    columns = {name: column(errors, name) for name in ("corner_px", "normal_deg", "flipped")}
    columns["place_percent"] = 100.0 * column(errors, "place_m") / column(errors, "distance_m")

    def judge(chosen: Chosen, part: str) -> Iterator[Metric]:
        asked = chosen & legible
        yield metric("tags", "read_share", resamples.mean(read[asked], asked), "higher", slice=part)
        right = chosen & read & ~wrong
        for name, source, share in _QUANTILES:
            told = right & np.isfinite(columns[source])
            estimate = resamples.quantile(columns[source][told], share, told)
            yield metric("tags", name, estimate, "lower", of=int(right.sum()), slice=part)
        posed = right & np.isfinite(columns["flipped"])
        flips = resamples.mean(columns["flipped"][posed], posed)
        yield metric("tags", "flip_share", flips, "lower", of=int(right.sum()), slice=part)

    every = int(read.sum())
    count = Estimate(float(wrong.sum()), None, None, every) if every else UNDEFINED
    return [*over_parts(judge, errors, PARTS), metric("tags", "wrong_ids", count, "lower")]


_QUANTILES = (
    ("corner_px_median", "corner_px", 0.5),
    ("corner_px_p95", "corner_px", 0.95),
    ("place_percent_median", "place_percent", 0.5),
    ("normal_deg_median", "normal_deg", 0.5),
)


def tag_error_rows(model: str, errors: Iterable[TagError]) -> Iterator[Row]:
    """Yield the rows of tag_errors.csv: true tags that were read or are legible."""
    for e in errors:
        if not e.wrong:
            flipped = None if e.flipped is None else int(e.flipped)
            known = e.tag_px, e.distance_m, e.tilt_deg, e.corner_px, e.place_m, e.normal_deg
            yield model, e.clip, e.frame, int(e.read), *known, flipped, e.tag_id
