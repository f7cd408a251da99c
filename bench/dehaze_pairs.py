"""Pictures through fog with the same scene in clear air."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from bench.detect_sets import PAD, RENDERED, SIZE, PictureSet, made_set
from landtool.dehaze.config import DehazeConfig
from landtool.dehaze.stage import dehazed
from landtool.io.images import read_picture
from landtool.synth.domain import Domain
from landtool.synth.fog_pair import make_fog_pair
from landtool.types import Image

LEAST_BETA, LEAST_TRANSMISSION = 0.05, 0.08  # thinner fog does little, behind thicker one nothing is left to be seen
PAIRS, SEED = 120, 21  # tools/fit_veil.py draws from seeds 11 to 13
CLEAR, CLEAR_SEED = 150, 22
FOGGY = Domain(fog=1.0, visibility_m=(8.0, 78.0), absent=0.1)


@dataclass(frozen=True, eq=False)
class Pair:
    """haze: 1 - t of the median pixel. distance_m: to what the median pixel sees. Both NaN where it is not known."""

    foggy: Image
    clear: Image
    beta_per_m: float
    haze: float = float("nan")
    distance_m: float = float("nan")


@lru_cache(maxsize=1)
def generator_pairs() -> Sequence[Pair]:
    """Return pairs of our own generator."""
    pairs: list[Pair] = []
    for index in itertools.count():
        if len(pairs) == PAIRS:
            return pairs
        made = make_fog_pair(FOGGY, PAD, SIZE, SEED, index)
        if made is None or made.fog.beta_per_m < LEAST_BETA or 1.0 - made.haze < LEAST_TRANSMISSION:
            continue
        pairs.append(Pair(made.foggy, made.clear, made.fog.beta_per_m, made.haze, made.distance_m))
    raise AssertionError


def rendered_pairs() -> Sequence[Pair]:
    """Return the path-traced pairs through a volume of fog that lie beside the project, none where they do not."""
    file = RENDERED / "fog" / "labels.csv"
    if not file.exists():
        return ()
    with file.open(encoding="utf-8", newline="") as lines:
        rows = [row for row in csv.DictReader(lines) if float(row["beta"]) >= LEAST_BETA]
    return [Pair(_read(RENDERED / r["file"]), _read(RENDERED / r["clear"]), float(r["beta"])) for r in rows]


@lru_cache(maxsize=1)
def clear_set() -> PictureSet:
    """Return pictures of our own generator without fog, with their boxes."""
    return made_set("own, clear", Domain(fog=0.0), CLEAR_SEED, range(CLEAR))


def clear_pictures() -> Sequence[Image]:
    """Return the same pictures alone."""
    return [clear_set().picture(index) for index in range(CLEAR)]


def path_traced_stills() -> Sequence[Image]:
    """Return the path-traced pictures in clear air that lie beside the project, none where they do not."""
    return [_read(path) for path in sorted((RENDERED / "stills").glob("*.jpg"))]


def dehazed_alone(image: Image, config: DehazeConfig | None = None) -> tuple[Image, float]:
    """Return a picture dehazed on its own, whatever its haze, and that haze."""
    seen = dehazed(image, config or DehazeConfig())
    return seen.image, seen.haze


def _read(path: Path) -> Image:
    return read_picture(path).image
