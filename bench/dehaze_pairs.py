"""Pictures through fog with the same scene in clear air, and how alike two pictures are."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.detect_sets import PAD, RENDERED, SIZE, PictureSet, made_set
from landtool.dehaze.config import DehazeConfig
from landtool.dehaze.stage import DehazeStage
from landtool.io.images import read_picture
from landtool.synth.domain import Domain
from landtool.synth.fog_pair import make_fog_pair
from landtool.types import Frame, Image

LEAST_BETA, LEAST_TRANSMISSION = 0.05, 0.08  # thinner fog does little, behind thicker one nothing is left to be seen
PAIRS, SEED = 120, 21  # tools/fit_veil.py draws from seeds 11 to 13
CLEAR, CLEAR_SEED = 150, 22
FOGGY = Domain(fog=1.0, visibility_m=(8.0, 78.0), absent=0.1)

_C1, _C2 = (0.01 * 255.0) ** 2, (0.03 * 255.0) ** 2
_WINDOW, _SIGMA = 11, 1.5


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
    seen = DehazeStage(config or DehazeConfig(), when="on").see(Frame(0, None, image))
    return seen.image, seen.haze


def ssim(a: Image, b: Image) -> float:
    """Return how alike two pictures (H, W, 3) are, 1 the same: the mean over pixels and channels.

    Z. Wang et al., Image quality assessment: from error visibility to structural similarity, 2004, with its Gaussian
    window; the same number as skimage's with gaussian_weights, use_sample_covariance=False, data_range=255.
    """
    x, y = a.astype(np.float32), b.astype(np.float32)
    mx, my = _mean(x), _mean(y)
    xx, yy, xy = _mean(x * x) - mx * mx, _mean(y * y) - my * my, _mean(x * y) - mx * my
    alike = (2.0 * mx * my + _C1) * (2.0 * xy + _C2) / ((mx * mx + my * my + _C1) * (xx + yy + _C2))
    inside = slice(_WINDOW // 2, -(_WINDOW // 2))  # where the whole window lies in the picture
    return float(alike[inside, inside].mean(dtype=np.float64))


def _mean(values: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(values, (_WINDOW, _WINDOW), _SIGMA), np.float32)


def _read(path: Path) -> Image:
    return read_picture(path).image
