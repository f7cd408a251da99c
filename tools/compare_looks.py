"""Show a generated data set beside pictures of other origin, and tell in numbers how they differ.

`python tools/compare_looks.py DATASET OUT.png [FOLDER...]`: OUT.png shows pictures of DATASET on the left and of the
folders on the right; the table has the quartiles and the median of simple statistics over each set. Without a FOLDER
only DATASET's numbers are printed. Any of them may be a plain folder of images.
"""

from __future__ import annotations

import argparse
import math
import string
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.errors import LandtoolError
from landtool.io.images import SUFFIXES, PictureError, natural_key, read_picture
from landtool.synth.preview.facts import read_facts
from landtool.synth.preview.sheet import contact_sheet, evenly, fitted
from landtool.types import Image

SHOWN = 60
SIDE_BY = 6  # columns a side
CELL = (192, 144)
MEASURED_AT = (640, 480)  # pictures of another size are brought to it, so that scales in pixels compare
LIMIT = 400  # of a set are measured

Grey = NDArray[np.float32]
Values = NDArray[np.float64]


def main() -> int:
    """Write the sheet and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("folder", type=Path, nargs="*")
    parser.add_argument("--clear", action="store_true", help="only the pictures of DATASET without fog")
    options = parser.parse_args()
    try:
        print(compare(options.dataset, options.output, options.folder, clear=options.clear))
    except LandtoolError as error:
        parser.exit(error.exit_code, f"compare_looks: {error}\n")
    return 0


def compare(dataset: Path, output: Path, folders: Sequence[Path], *, clear: bool = False) -> str:
    """Write the sheet to `output` and return the table. Raises LandtoolError for folders that hold no pictures."""
    ours = without_fog(dataset) if clear else pictures_of(dataset)
    others = {folder: pictures_of(folder) for folder in folders}
    mixed = [path for paths in others.values() for path in (paths[i] for i in evenly(len(paths), SHOWN // len(others)))]
    rows = math.ceil(min(max(len(ours), len(mixed)), SHOWN) / SIDE_BY)
    sheet = side(ours, rows)
    if mixed:
        gap = np.full((len(sheet), 12, 3), 255, np.uint8)
        sheet = np.concatenate([sheet, gap, side(mixed, rows)], axis=1)
    if not cv2.imwrite(str(output), sheet):
        raise LandtoolError("cannot be written", file=output)
    sets = {str(dataset): ours} | {str(folder): paths for folder, paths in others.items()}
    return table({name: measure(paths) for name, paths in sets.items()})


def pictures_of(folder: Path) -> list[Path]:
    """Return the images of a folder and its subfolders in natural order."""
    paths = [path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file()]
    # what a preview wrote beside the data set is no part of it
    paths = [path for path in paths if path.name not in ("preview.png", "statistics.png")]
    if not paths:
        raise LandtoolError("holds no images", file=folder, hint="give a folder of pictures")
    return sorted(paths, key=lambda path: natural_key(str(path.relative_to(folder))))


def without_fog(dataset: Path) -> list[Path]:
    """Return the pictures of a data set that are clear. Raises LandtoolError when its truth.csv cannot be read."""
    facts = read_facts(dataset)
    return [dataset / file for file, beta in zip(facts.files, facts.numbers["beta_per_m"], strict=True) if beta == 0.0]


def side(paths: Sequence[Path], rows: int) -> Image:
    """Return one half of the sheet."""
    chosen = [paths[i] for i in evenly(len(paths), SHOWN)]
    return contact_sheet((fitted(_read(path), *CELL)[0] for path in chosen), SIDE_BY, rows, *CELL)


def measure(paths: Sequence[Path]) -> dict[str, Values]:
    """Return each statistic of up to LIMIT evenly chosen pictures, (N,)."""
    rows = [statistics(_read(paths[i])) for i in evenly(len(paths), LIMIT)]
    return {name: np.array([row[name] for row in rows]) for name in STATISTICS}


def statistics(image: Image) -> dict[str, float]:
    """Return the statistics of one picture (H, W, 3) BGR."""
    height, width = image.shape[:2]
    if max(width, height) != MEASURED_AT[0]:
        image = fitted(image, *MEASURED_AT)[0]
    grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.float32)
    return {name: float(of(image, grey)) for name, of in STATISTICS.items()}


def table(sets: dict[str, dict[str, Values]]) -> str:
    """Return the quartiles of every statistic of every set.

    Behind those of each further set stands how far the first set's median lies from its own, in half distances of its
    quartiles: within -1 and 1 the first set's median is a usual picture there.
    """
    letters = string.ascii_uppercase[: len(sets)]
    lines = [f"{x}: {name}, {len(s[FIRST])} pictures" for x, (name, s) in zip(letters, sets.items(), strict=True)]
    lines.append(f"{'25 %, median, 75 %':<24}" + "".join(f"{x:^34}" for x in letters))
    for statistic in STATISTICS:
        quartiles = [np.nanpercentile(s[statistic], [25, 50, 75]) for s in sets.values()]
        cells = []
        for i, (low, middle, high) in enumerate(quartiles):
            apart = (quartiles[0][1] - middle) / max((high - low) / 2.0, 1e-6)
            cells.append(f"{low:8.3g} {middle:8.3g} {high:8.3g} " + (f"{np.clip(apart, -99, 99):+6.1f}  " if i else ""))
        lines.append(f"{statistic:<24}" + "".join(f"{cell:<34}" for cell in cells))
    return "\n".join(lines)


def _read(path: Path) -> Image:
    try:
        return read_picture(path).image
    except PictureError as error:
        raise LandtoolError(str(error), file=path) from error


def _saturation(image: Image, _: Grey) -> float:
    return float(cv2.cvtColor(image, cv2.COLOR_BGR2HSV)[:, :, 1].mean()) / 255.0


def _chroma(image: Image, _: Grey) -> float:
    """Return the mean distance from grey in CIE Lab, which does not grow in the dark as saturation does."""
    lab = cv2.cvtColor(image.astype(np.float32) / 255.0, cv2.COLOR_BGR2LAB)
    return float(np.hypot(lab[:, :, 1], lab[:, :, 2]).mean())


def _gradient(level: int) -> Callable[[Image, Grey], float]:
    """Return log10 of the mean squared gradient after halving the picture `level` times, grey levels per pixel."""

    def energy(_: Image, grey: Grey) -> float:
        for _level in range(level):
            grey = np.asarray(cv2.pyrDown(grey), np.float32)
        dx, dy = grey[1:-1, 2:] - grey[1:-1, :-2], grey[2:, 1:-1] - grey[:-2, 1:-1]
        return math.log10(float((dx * dx + dy * dy).mean()) / 4.0 + 1e-6)

    return energy


def _residual(grey: Grey) -> Grey:
    """Return the picture without what is locally a plane: J. Immerkaer, "Fast noise variance estimation", 1996."""
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6.0  # white noise keeps its deviation
    return np.asarray(cv2.filter2D(grey, cv2.CV_32F, mask), np.float32)[1:-1, 1:-1]


def _calm(grey: Grey, side_px: int = 16) -> tuple[Grey, Grey]:
    """Return the residual's blocks (B, side, side) and their mean absolute values, without blocks that clip."""
    cut = grey[1:-1, 1:-1]
    rows, columns = (n // side_px for n in cut.shape)

    def blocks(values: Grey) -> Grey:
        whole = values[: rows * side_px, : columns * side_px]
        return whole.reshape(rows, side_px, columns, side_px).swapaxes(1, 2).reshape(-1, side_px, side_px)

    level = blocks(cut).mean(axis=(1, 2))
    kept = blocks(_residual(grey))[(level > 8) & (level < 247)]
    return kept, np.abs(kept).mean(axis=(1, 2))


def _noise(_: Image, grey: Grey) -> float:
    """Return the noise of the calmest tenth of the picture, grey levels; texture counts as little as it can."""
    amounts = _calm(grey)[1]
    return math.sqrt(math.pi / 2.0) * float(np.percentile(amounts, 10)) if len(amounts) else 0.0


def _texture(_: Image, grey: Grey) -> float:
    """Return the same of the median block: finest texture and noise together."""
    amounts = _calm(grey)[1]
    return math.sqrt(math.pi / 2.0) * float(np.median(amounts)) if len(amounts) else 0.0


def _edge_width(_: Image, grey: Grey) -> float:
    """Return how many pixels the strongest edges take from dark to light, the median; a step takes 2 or less."""
    dx, dy = cv2.Sobel(grey, cv2.CV_32F, 1, 0, scale=0.125), cv2.Sobel(grey, cv2.CV_32F, 0, 1, scale=0.125)
    slope = np.hypot(dx, dy)
    square = np.ones((9, 9), np.uint8)
    height = cv2.dilate(grey, square) - cv2.erode(grey, square)
    # the steepest place across an edge, or its flanks would count as an unsharp edge
    top = (slope > 0) & (slope >= cv2.dilate(slope, np.ones((3, 3), np.uint8)))
    strong = top & (slope >= np.percentile(slope, 99)) & (height > 20)
    return float(np.median(height[strong] / slope[strong])) if strong.any() else math.nan


STATISTICS: dict[str, Callable[[Image, Grey], float]] = {
    "luminance mean, 0-255": lambda _, grey: float(grey.mean()),
    "luminance 1 %": lambda _, grey: float(np.percentile(grey, 1)),
    "luminance 99 %": lambda _, grey: float(np.percentile(grey, 99)),
    "contrast (std)": lambda _, grey: float(grey.std()),
    "saturation, 0-1": _saturation,
    "chroma, Lab": _chroma,
    "blue over red": lambda image, _: float(image[:, :, 0].mean() / max(image[:, :, 2].mean(), 1.0)),
    "gradient 1 px, log10": _gradient(0),
    "gradient 2 px, log10": _gradient(1),
    "gradient 4 px, log10": _gradient(2),
    "gradient 8 px, log10": _gradient(3),
    "noise, grey levels": _noise,
    "finest texture": _texture,
    "edge width, px": _edge_width,
    "white clipped, %": lambda image, _: 100.0 * float((image.max(axis=2) >= 254).mean()),
    "black clipped, %": lambda image, _: 100.0 * float((image.max(axis=2) <= 1).mean()),
}
FIRST = next(iter(STATISTICS))


if __name__ == "__main__":
    raise SystemExit(main())
