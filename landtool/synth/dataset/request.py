"""What a dataset is asked to be, and what of it cannot be done."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.errors import InputError, UsageError
from landtool.families import tag_family
from landtool.geometry import Array
from landtool.io.labels import SPLITS
from landtool.io.run_record import HashedFile, installed_versions
from landtool.pad import PadSpec, PadTag
from landtool.synth.domain import Domain

FORMAT_VERSION = 1
SIDE_PX = (64, 4096)
MOST_IMAGES = 10_000_000


@dataclass(frozen=True)
class DatasetRequest:
    """All that the bytes of a dataset depend on; picture i depends on everything but n and split.

    n: pictures. size: width and height, pixels. split: shares of train, val and, if there are three, test.
    photos: backgrounds, with the digest of each. clear: for each picture in fog the same in clear air, too.

    Raises UsageError for what cannot be made, InputError for a pad without a ring, with something printed over the
    ring, or whose tags do not fit on it.
    """

    n: int
    seed: int
    size: tuple[int, int]
    split: tuple[float, ...]
    domain: Domain
    pad: PadSpec
    photos: tuple[HashedFile, ...] = ()
    clear: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.n <= MOST_IMAGES:
            raise UsageError(f"{self.n} images cannot be made", hint=f"give 1 to {MOST_IMAGES}")
        if self.seed < 0:
            raise UsageError(f"seed = {self.seed} is negative", hint="give 0 or more")
        refuse_size(self.size)
        refuse_split(self.split)
        refuse_covered_ring(self.pad)
        refuse_misplaced_tags(self.pad)

    @property
    def photo_paths(self) -> tuple[Path, ...]:
        """The backgrounds' paths."""
        return tuple(Path(photo.path) for photo in self.photos)

    @property
    def splits(self) -> tuple[str, ...]:
        """The names of the splits there are."""
        return SPLITS[: len(self.split)]

    def split_of_images(self) -> list[str]:
        """Return the split of each picture: as many as the shares ask for, rounded, drawn by the seed."""
        counts = _counts(self.n, self.split)
        order = np.random.default_rng([self.seed, self.n]).permutation(self.n)
        found = [""] * self.n
        ends = np.cumsum([0, *counts])
        for name, start, end in zip(self.splits, ends[:-1], ends[1:], strict=True):
            for index in order[start:end]:
                found[index] = name
        return found

    def stem(self, index: int) -> str:
        """Return a picture's file name without its ending."""
        return f"{index:0{max(6, len(str(self.n - 1)))}d}"

    def as_values(self) -> dict[str, Any]:
        """Return everything as plain values, for the manifest; photographs by name, wherever they lie."""
        return {
            "format_version": FORMAT_VERSION,
            "seed": self.seed,
            "n": self.n,
            "size": list(self.size),
            "split": dict(zip(self.splits, self.split, strict=True)),
            "versions": installed_versions(),
            "domain": asdict(self.domain),
            "pad": asdict(self.pad),
            "backgrounds": [{"file": Path(photo.path).name, "sha256": photo.sha256} for photo in self.photos],
            "clear": self.clear,
        }

    def as_text(self) -> str:
        """Return all of it as one text; two requests that differ have different ones."""
        return json.dumps(self.as_values(), sort_keys=True)


def refuse_size(size: tuple[int, int]) -> None:
    """Raise UsageError for a picture size (width, height) nobody can use."""
    low, high = SIDE_PX
    if not all(low <= side <= high for side in size):
        raise UsageError(f"a picture of {size[0]}x{size[1]} cannot be made", hint=f"give {low} to {high} pixels a side")


def refuse_split(split: Sequence[float]) -> None:
    """Raise UsageError unless there are two or three shares that add up to 1."""
    text = ",".join(f"{share:g}" for share in split)
    if len(split) not in (2, 3) or not all(0.0 <= share <= 1.0 for share in split) or not split[0]:
        raise UsageError(f"split {text} is impossible", hint="give the shares of train, val and test, as 0.8,0.1,0.1")
    if abs(sum(split) - 1.0) > 1e-6:
        hint = "the shares of train, val and test must add up to 1, as 0.8,0.1,0.1"
        raise UsageError(f"split {text} adds up to {sum(split):g}", hint=hint)


def refuse_covered_ring(pad: PadSpec) -> None:
    """Raise InputError when there is no ring to label, it is larger than the board, or something is printed over it."""
    if pad.ring is None:
        raise InputError("the pad has no ring to draw a box around", hint="give a pad with [ring]")
    if pad.board and pad.board.side < pad.ring.outer:
        raise InputError("the ring sticks out of the board", hint="make the ring smaller or the board larger")
    letter, zone = pad.letter, pad.quiet_zone
    for name, width, height in (
        ("H", letter.width if letter else 0.0, letter.height if letter else 0.0),
        ("quiet zone", zone.side if zone else 0.0, zone.side if zone else 0.0),
    ):
        if math.hypot(width, height) > pad.ring.inner + 1e-9:
            raise InputError(f"the {name} lies on the ring", hint=f"make the {name} smaller")


def refuse_misplaced_tags(pad: PadSpec) -> None:
    """Raise InputError when a tag sticks out of the board, lies on the ring, or on another tag."""
    prints = [(tag.id, _printed_square(pad, tag)) for tag in pad.tags]
    for number, (tag_id, corners) in enumerate(prints):
        if pad.board and np.abs(corners).max() > pad.board.side * pad.diameter_m / 2.0 + 1e-9:
            hint = "make the tag smaller or the board larger"
            raise InputError(f"tag {tag_id} does not fit on the board with its white border", hint=hint)
        if pad.ring and _on_ring(corners, pad.ring.inner * pad.diameter_m, pad.ring.outer * pad.diameter_m):
            raise InputError(f"tag {tag_id} with its white border lies on the ring", hint="make the tag smaller")
        for other_id, other in prints[:number]:
            shared, _ = cv2.intersectConvexConvex(_f32(corners), _f32(other))
            if shared > 1e-4 * cv2.contourArea(_f32(corners)):
                raise InputError(f"tags {other_id} and {tag_id} lie on each other", hint="move one of them")


def _printed_square(pad: PadSpec, tag: PadTag) -> Array:
    """Return the corners (4, 2) of a tag with its white border, pad frame, metres."""
    family = tag_family(tag.family)
    grown = replace(tag, size=tag.size * family.total_modules / family.border_modules)
    return pad.tag_corners_m(grown)[:, :2]


def _on_ring(corners: Array, inner_m: float, outer_m: float) -> bool:
    """Whether a square (4, 2) about the centre or beside it covers a part of the ring's paint."""
    farthest = float(np.hypot(*corners.T).max())
    # the nearest point of the square: inside, on an edge or at a corner
    nearest = max(0.0, -cv2.pointPolygonTest(_f32(corners), (0.0, 0.0), True))
    return farthest > inner_m / 2.0 + 1e-9 and nearest < outer_m / 2.0 - 1e-9


def _f32(points: Array) -> NDArray[np.float32]:
    """Return points as OpenCV takes them."""
    return points.astype(np.float32)


def _counts(n: int, split: Sequence[float]) -> list[int]:
    """Return how many pictures each split gets: n in all, each within one of its share."""
    exact = [share * n for share in split]
    counts = [math.floor(value + 1e-6) for value in exact]
    # the largest remainders get what rounding down left
    behind = sorted(range(len(split)), key=lambda i: counts[i] - exact[i])
    for i in behind[: n - sum(counts)]:
        counts[i] += 1
    return counts
