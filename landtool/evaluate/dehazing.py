"""How much nearer to the same view in clear air a dehazer brings a picture, and what it does to one without haze."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.errors import InputError
from landtool.evaluate.bootstrap import UNDEFINED, Estimate, Resamples
from landtool.evaluate.facts import parts
from landtool.evaluate.metric import Metric, metric
from landtool.io.images import SUFFIXES, natural_key
from landtool.io.tables import Columns, Row, column_names, read_rows
from landtool.types import Image

# Two pictures of 8 bits that are alike to the last digit may still differ by their rounding, of variance 1/12: what is
# nearer than that is not told apart, and a picture equal to its twin has a PSNR, too
_ROUNDING = 1.0 / 12.0
MOST_DB = 10.0 * math.log10(255.0**2 / _ROUNDING)

_C1, _C2 = (0.01 * 255.0) ** 2, (0.03 * 255.0) ** 2
_WINDOW, _SIGMA = 11, 1.5
_FACT = "fog_per_m"


DEHAZE_ERROR_COLUMNS: Columns = {
    "part": str,
    "file": str,
    **dict.fromkeys(("fog_per_m", "haze", "psnr_before_db", "psnr_after_db", "ssim_before", "ssim_after"), float),
}
"""The columns of dehaze_errors.csv."""


@dataclass(frozen=True)
class FogPair:
    """A picture in haze and the same view in clear air. name: of the hazy one within its folder.

    fog_per_m: extinction, None where nobody says it.
    """

    name: str
    hazy: Path
    clear: Path
    fog_per_m: float | None = None


@dataclass(frozen=True)
class PairScore:
    """How near a picture is to its clear twin before and after dehazing: PSNR in dB, SSIM in [-1, 1]."""

    psnr_before_db: float
    psnr_after_db: float
    ssim_before: float
    ssim_after: float


@dataclass(frozen=True)
class ScoredPair:
    """A row of dehaze_errors.csv. haze: as the dehazer told it, 1 - t. unit: what is resampled as one."""

    part: str
    file: str
    unit: Hashable
    fog_per_m: float | None
    haze: float | None
    score: PairScore


def dehaze_error_row(pair: ScoredPair) -> Row:
    """Return the row of dehaze_errors.csv."""
    score = pair.score
    near = score.psnr_before_db, score.psnr_after_db, score.ssim_before, score.ssim_after
    return pair.part, pair.file, pair.fog_per_m, pair.haze, *near


@dataclass(frozen=True)
class ClearChange:
    """What `auto` did to a picture without haze. change_levels: root mean square, grey levels; 0 where left alone."""

    unit: Hashable
    change_levels: float


def find_pairs(folder: Path) -> tuple[FogPair, ...]:
    """Return the pairs of a folder in natural order of their names, none where it holds no pairs.

    Known are: a dataset of `landtool generate images --clear` (images/ and clear/), fog_* and clear_* in one folder,
    and two folders hazy/ and clear/, whose names are equal or the hazy one's goes on after the clear one's, as
    0001_0.8_0.2.jpg and 0001.png.

    Raises InputError for a picture whose other half is missing, and for a broken truth.csv or labels.csv.
    """
    found = _of_dataset(folder) or _of_prefixes(folder) or _of_two_folders(folder)
    return tuple(sorted(found, key=lambda pair: natural_key(pair.name)))


def pair_score(before: Image, after: Image, clear: Image) -> PairScore:
    """Return how near two pictures (H, W, 3) are to a third. Raises InputError unless all have one size, from 11 px."""
    return PairScore(psnr_db(before, clear), psnr_db(after, clear), ssim(before, clear), ssim(after, clear))


def psnr_db(image: Image, clear: Image) -> float:
    """Return the peak signal-to-noise ratio over all pixels and channels, at most MOST_DB. Raises as `pair_score`."""
    _refuse_unlike(image, clear)
    # PSNR = 10 log10(255^2 / MSE)
    return 10.0 * math.log10(255.0**2 / max(_mean_square(image, clear), _ROUNDING))


def ssim(image: Image, clear: Image) -> float:
    """Return how alike two pictures (H, W, 3) are, 1 the same: the mean over the pixels of each channel by itself.

    Z. Wang et al., Image quality assessment: from error visibility to structural similarity, 2004, with its Gaussian
    window of 11 pixels, where that lies in the picture; skimage's with gaussian_weights, use_sample_covariance=False.
    Raises as `pair_score`.
    """
    _refuse_unlike(image, clear)
    x, y = image.astype(np.float32), clear.astype(np.float32)
    mx, my = _blurred(x), _blurred(y)
    xx, yy, xy = _blurred(x * x) - mx * mx, _blurred(y * y) - my * my, _blurred(x * y) - mx * my
    # (2 mx my + C1) (2 s_xy + C2) / ((mx^2 + my^2 + C1) (s_x^2 + s_y^2 + C2))
    alike = (2.0 * mx * my + _C1) * (2.0 * xy + _C2) / ((mx * mx + my * my + _C1) * (xx + yy + _C2))
    inside = slice(_WINDOW // 2, -(_WINDOW // 2))
    return float(alike[inside, inside].mean(dtype=np.float64))


def change_levels(image: Image, changed: Image) -> float:
    """Return the root mean square by which two pictures (H, W, 3) of one size differ, grey levels."""
    return math.sqrt(_mean_square(image, changed))


def dehaze_metrics(scores: Sequence[ScoredPair], clear: Sequence[ClearChange]) -> list[Metric]:
    """Return what dehazing is worth on pictures in haze, by their fog, and what it does to those without.

    better_share: of the pairs, those better in PSNR and in SSIM. worst_db: the least gain of PSNR; a bootstrap tells
    nothing of the worst one, so it has no interval. clear_change_levels, clear_changed_share: of the pictures without
    haze, how much `auto` changes them, and how many.
    """
    resamples = Resamples([score.unit for score in scores])
    everything = np.arange(len(scores))
    made = list(_gains(scores, resamples, everything, ""))
    before = [score.score.psnr_before_db for score in scores], [score.score.ssim_before for score in scores]
    after = [score.score.psnr_after_db for score in scores], [score.score.ssim_after for score in scores]
    made += [
        metric("dehaze", name, resamples.mean(values), "neither") for name, values in zip(_BEFORE, before, strict=True)
    ]
    made += [
        metric("dehaze", name, resamples.mean(values), "higher") for name, values in zip(_AFTER, after, strict=True)
    ]
    gains = _psnr_gains(scores)
    worst = Estimate(min(gains), None, None, len(gains)) if gains else UNDEFINED
    made.append(metric("dehaze", "worst_db", worst, "higher"))
    of_clear = Resamples([change.unit for change in clear])
    levels = [change.change_levels for change in clear]
    made.append(metric("dehaze", "clear_change_levels", of_clear.mean(levels), "lower"))
    made.append(metric("dehaze", "clear_changed_share", of_clear.mean([level > 0.0 for level in levels]), "lower"))
    for name, inside in parts(_FACT, [score.fog_per_m for score in scores]):
        made += _gains(scores, resamples, everything[inside], name)
    return made


_BEFORE, _AFTER = ("psnr_before_db", "ssim_before"), ("psnr_after_db", "ssim_after")


def _psnr_gains(scores: Sequence[ScoredPair]) -> list[float]:
    return [score.score.psnr_after_db - score.score.psnr_before_db for score in scores]


def _gains(
    scores: Sequence[ScoredPair], resamples: Resamples, chosen: NDArray[np.int64], part: str
) -> Iterator[Metric]:
    some = [scores[i] for i in chosen]
    psnr = _psnr_gains(some)
    alike = [score.score.ssim_after - score.score.ssim_before for score in some]
    both = [gain > 0.0 and more > 0.0 for gain, more in zip(psnr, alike, strict=True)]
    yield metric("dehaze", "psnr_gain_db_mean", resamples.mean(psnr, chosen), "higher", slice=part)
    yield metric("dehaze", "ssim_gain", resamples.mean(alike, chosen), "higher", slice=part)
    yield metric("dehaze", "better_share", resamples.mean(both, chosen), "higher", slice=part)


def _mean_square(image: Image, other: Image) -> float:
    return float(cv2.norm(image, other, cv2.NORM_L2SQR)) / max(image.size, 1)


def _blurred(values: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(values, (_WINDOW, _WINDOW), _SIGMA), np.float32)


def _refuse_unlike(image: Image, clear: Image) -> None:
    if image.shape != clear.shape:
        sizes = [f"{shape[1]}x{shape[0]}" for shape in (image.shape, clear.shape)]
        raise InputError(f"a picture of {sizes[0]} and its clear twin of {sizes[1]}", hint="give pictures of one size")
    if min(image.shape[:2]) < _WINDOW:
        raise InputError(
            f"a picture of {image.shape[1]}x{image.shape[0]} is too small to compare", hint="11 px or more"
        )


def _of_dataset(folder: Path) -> list[FogPair]:
    images, clear = folder / "images", folder / "clear"
    if not (images.is_dir() and clear.is_dir()):
        return []
    fog = _column(folder / "truth.csv", "beta_per_m")
    hazy = {path.relative_to(images).with_suffix(""): path for path in _pictures(images, deep=True)}
    found = []
    for path in _pictures(clear, deep=True):
        twin = hazy.get(path.relative_to(clear).with_suffix(""))
        if twin is None:
            raise InputError("is no twin of a picture in images/", file=path, hint="generate the dataset again")
        name = twin.relative_to(folder).as_posix()
        found.append(FogPair(name, twin, path, fog.get(name)))
    paired = {pair.name for pair in found}
    for path in hazy.values() if found else ():
        name = path.relative_to(folder).as_posix()
        if fog.get(name, 0.0) > 0.0 and name not in paired:
            raise InputError("has no twin in clear air", file=path, hint="generate the dataset again")
    return found


def _of_prefixes(folder: Path) -> list[FogPair]:
    pictures = _pictures(folder)
    clear = {path.stem.removeprefix("clear_"): path for path in pictures if path.stem.startswith("clear_")}
    foggy = [path for path in pictures if path.stem.startswith("fog_")]
    if not (clear and foggy):
        return []
    fog = {Path(name).name: beta for name, beta in _column(folder / "labels.csv", "beta").items()}
    return [FogPair(p.name, p, _twin(p, clear, p.stem.removeprefix("fog_")), fog.get(p.name)) for p in foggy]


def _of_two_folders(folder: Path) -> list[FogPair]:
    if not ((folder / "hazy").is_dir() and (folder / "clear").is_dir()):
        return []
    clear = {path.stem: path for path in _pictures(folder / "clear")}
    return [FogPair(p.name, p, _twin(p, clear, _longest(p.stem, clear))) for p in _pictures(folder / "hazy")]


def _longest(stem: str, clear: Mapping[str, Path]) -> str:
    """Return the longest name that a hazy one's begins with, and does not go on as a word or number: 10_1 is no 1."""
    begins = [name for name in clear if stem.startswith(name) and not stem[len(name) : len(name) + 1].isalnum()]
    return max(begins, key=len, default="")


def _twin(path: Path, clear: Mapping[str, Path], name: str) -> Path:
    if name not in clear:
        raise InputError("has no twin in clear air", file=path, hint="add the clear picture of its name or remove it")
    return clear[name]


def _pictures(folder: Path, *, deep: bool = False) -> list[Path]:
    files = folder.rglob("*") if deep else folder.iterdir()
    return sorted(path for path in files if path.suffix.lower() in SUFFIXES and not path.name.startswith("."))


def _column(table: Path, name: str) -> dict[str, float]:
    """Return a column of a table by the column `file`; empty where there is no such table or column."""
    if not table.is_file() or not {"file", name} <= set(column_names(table)):
        return {}
    rows = read_rows(table, {"file": str, name: float})
    return {str(row["file"]): value for row in rows if isinstance(value := row[name], float)}
