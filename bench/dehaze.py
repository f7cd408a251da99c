"""Dehazing against the same scene in clear air, the haze it tells, its time, its flicker, and detection through fog.

`python -m bench dehaze` prints all of it, `python -m bench.dehaze PART...` parts: quality, haze, speed, flicker,
detector. The package image-dehazer (MIT) is compared where it is installed; nothing of landtool needs it.
"""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from bench.dehaze_detector import print_detector
from bench.dehaze_flicker import print_flicker
from bench.dehaze_pairs import (
    LEAST_BETA,
    Pair,
    clear_pictures,
    dehazed_alone,
    generator_pairs,
    path_traced_stills,
    rendered_pairs,
)
from bench.dehaze_speed import print_speed
from bench.show import table
from bench.textbook import textbook
from landtool.dehaze.config import DehazeConfig
from landtool.evaluate.dehazing import ssim
from landtool.geometry import Array
from landtool.synth.fog import KOSCHMIEDER
from landtool.types import Image

LOSS_DB = 2.0  # a picture that loses more is spoilt
BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # of the median transmission
HAZY = 0.3  # what the gate must not pass over
GOALS = "goals for veil: median >= +3 dB and >= +0.04, better in both >= 75 %, none worse than -2 dB"

Method = Callable[[Image], Image]


@dataclass(frozen=True, eq=False)
class Compared:
    """A method on some pairs. psnr_db, ssim: (N, 2), of the input and of what was made of it."""

    name: str
    psnr_db: Array
    ssim: Array

    @property
    def gain_db(self) -> Array:
        """(N,)."""
        return np.asarray(self.psnr_db[:, 1] - self.psnr_db[:, 0])

    @property
    def gain_ssim(self) -> Array:
        """(N,)."""
        return np.asarray(self.ssim[:, 1] - self.ssim[:, 0])

    def of(self, chosen: Array) -> Compared:
        """Return the same of some of the pairs."""
        return Compared(self.name, self.psnr_db[chosen], self.ssim[chosen])


def main(parts: Sequence[str] = ()) -> None:
    """Print all tables, or those of some parts."""
    cv2.setNumThreads(1)
    for name in parts or PARTS:
        PARTS[name]()


def print_quality() -> None:
    """Print how near every method comes to the clear picture."""
    rendered = rendered_pairs()
    if rendered:
        _print_gains(f"{len(rendered)} path-traced pairs, beta >= {LEAST_BETA:g}", _compared(rendered))
    else:
        print("\nrendered/fog: not there, left out")
    pairs = generator_pairs()
    compared = _compared(pairs)
    _print_gains(f"{len(pairs)} pairs of our generator, beta >= {LEAST_BETA:g}", compared)
    _print_bins(1.0 - np.array([pair.haze for pair in pairs]), compared)


def print_haze() -> None:
    """Print how well the haze is told that the gate of `--dehaze auto` goes by."""
    config = DehazeConfig()
    pairs = generator_pairs()
    said = np.array([dehazed_alone(pair.foggy)[1] for pair in pairs])
    true = np.array([pair.haze for pair in pairs])
    # t = exp(-beta d), V = 3.912 / beta
    depth = -np.log(np.maximum(1.0 - said, 1e-6))
    ratio = KOSCHMIEDER * np.array([pair.distance_m for pair in pairs]) / np.maximum(depth, 1e-6)
    ratio /= np.array([KOSCHMIEDER / pair.beta_per_m for pair in pairs])
    off = np.exp(np.abs(np.log(ratio)))
    hazy = true > HAZY
    rows: list[tuple[str, str]] = [
        ("median absolute error of haze", f"{np.median(np.abs(said - true)):.3f}"),
        ("median error of haze", f"{np.median(said - true):+.3f}"),
        ("rank correlation", f"{spearmanr(said, true).statistic:.3f}"),
        ("visibility by haze and known distance: median of said / true", f"{np.median(ratio):.2f}"),
        ("the same, off by a factor of, median", f"{np.median(off):.2f}"),
        ("within a factor of 1.5", _percent(off < 1.5)),
        (f"haze > {HAZY:g}: passed over by the gate", f"{_percent(said[hazy] < config.haze_on)} of {hazy.sum()}"),
    ]
    for name, images in (("our generator", clear_pictures()), ("path-traced", path_traced_stills())):
        if images:
            haze = np.array([dehazed_alone(image)[1] for image in images])
            rows.append((f"clear, {name}: haze in the median", f"{np.median(haze):.3f}"))
            rows.append((f"clear, {name}: taken for hazy", f"{_percent(haze >= config.haze_on)} of {len(haze)}"))
    table(f"Haze told, {len(pairs)} pairs of our generator; the gate opens at {config.haze_on:g}", ["", ""], rows)


def _methods() -> dict[str, Method | None]:
    """Return the ways to dehaze, None for one that is not installed."""
    veil, paper = DehazeConfig(), DehazeConfig(recipe="paper")

    def auto(image: Image) -> Image:
        made, haze = dehazed_alone(image)
        return made if haze >= veil.haze_on else image

    return {
        "veil, on": lambda image: dehazed_alone(image)[0],
        "veil, auto": auto,
        "paper, guided": lambda image: dehazed_alone(image, paper)[0],
        "textbook": textbook,
        "textbook, linear light": lambda image: textbook(image, linear=True),
        "image-dehazer": _image_dehazer(),
    }


def _image_dehazer() -> Method | None:
    try:
        package = importlib.import_module("image_dehazer")
    except ImportError:
        return None
    if not hasattr(np, "alltrue"):
        setattr(np, "alltrue", np.all)  # noqa: B010 - version 0.0.9 calls it, NumPy 2 has dropped it
    return lambda image: np.asarray(package.remove_haze(image, showHazeTransmissionMap=False)[0], np.uint8)


def _compared(pairs: Sequence[Pair]) -> list[Compared | str]:
    """Return every method on all pairs; the name alone of one that is not installed."""
    before = [(float(cv2.PSNR(pair.foggy, pair.clear)), ssim(pair.foggy, pair.clear)) for pair in pairs]
    made: list[Compared | str] = []
    for name, method in _methods().items():
        if method is None:
            made.append(name)
            continue
        images = [method(pair.foggy) for pair in pairs]
        after = [(float(cv2.PSNR(i, p.clear)), ssim(i, p.clear)) for i, p in zip(images, pairs, strict=True)]
        psnr_db, alike = np.stack([np.array(before), np.array(after)], axis=1).transpose(2, 0, 1)
        made.append(Compared(name, psnr_db, alike))
    return made


def _print_gains(title: str, compared: Sequence[Compared | str]) -> None:
    first = next(each for each in compared if isinstance(each, Compared))
    psnr_db, alike = np.median(first.psnr_db[:, 0]), np.median(first.ssim[:, 0])
    rows = [["hazy input", f"{psnr_db:.2f}", f"{alike:.3f}", *5 * ["-"]]]
    for each in compared:
        if isinstance(each, str):
            rows.append([each, "not installed", *6 * ["-"]])
            continue
        rows.append([
            each.name,
            f"{np.median(each.psnr_db[:, 1]):.2f}",
            f"{np.median(each.ssim[:, 1]):.3f}",
            f"{np.median(each.gain_db):+.2f}",
            f"{np.median(each.gain_ssim):+.3f}",
            _percent((each.gain_db > 0.0) & (each.gain_ssim > 0.0)),
            f"{each.gain_db.min():+.2f}",
            _percent(each.gain_db < -LOSS_DB),
        ])  # fmt: skip
    head = ["method", "PSNR, dB", "SSIM", "gain, dB", "gain, SSIM", "better in both", "worst, dB", "worse than -2 dB"]
    table(f"{title}: medians against the clear picture; {GOALS}", head, rows)


def _print_bins(transmission: Array, compared: Sequence[Compared | str]) -> None:
    places = np.digitize(transmission, BINS[1:-1])
    filled = [place for place in range(len(BINS) - 1) if (places == place).any()]
    rows = []
    for each in compared:
        if isinstance(each, Compared):
            parts = [each.of(places == place) for place in filled]
            rows.append([each.name, *(f"{np.median(p.gain_db):+.2f} {np.median(p.gain_ssim):+.3f}" for p in parts)])
    names = [f"t {BINS[place]:g}-{BINS[place + 1]:g}: {np.sum(places == place)}" for place in filled]
    table("The same by the median transmission, and pairs: median gain, dB and SSIM", ["method", *names], rows)


def _percent(flags: NDArray[np.bool_]) -> str:
    share = float(np.mean(flags)) if len(flags) else math.nan
    return f"{100.0 * share:.1f} %"


PARTS: dict[str, Callable[[], None]] = {
    "quality": print_quality,
    "haze": print_haze,
    "speed": print_speed,
    "flicker": print_flicker,
    "detector": print_detector,
}


if __name__ == "__main__":
    main(sys.argv[1:])
