"""Pictures that show no tag and look as if they might: what wrong ids are made of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.types import Image
from tests.shared import ROOT

WIDTH, HEIGHT = 320, 240
Grey = NDArray[np.uint8]


def photographs() -> list[Image]:
    """Return the real photographs from above beside the project; empty where they are not there."""
    folder: Path = ROOT.parent / "shared" / "data" / "backgrounds"
    pictures = [cv2.imread(str(path)) for path in sorted(folder.glob("*/*")) if path.suffix != ".md"]
    return [np.asarray(p, np.uint8) for p in pictures if p is not None and min(p.shape[:2]) >= 480]


def clutter(index: int, rng: np.random.Generator, real: Sequence[Image] = ()) -> Image:
    """Return picture number `index`: cells, framed false codes, shapes, noise and crops of photographs in turn."""
    kinds: list[Callable[[np.random.Generator], Grey]] = [_cells, _false_codes, _shapes, _noise]
    kind = index % (len(kinds) + bool(real))
    if kind == len(kinds):
        return _crop(rng, real)
    return np.asarray(cv2.cvtColor(kinds[kind](rng), cv2.COLOR_GRAY2BGR), np.uint8)


def _crop(rng: np.random.Generator, real: Sequence[Image]) -> Image:
    picture = real[int(rng.integers(len(real)))]
    height, width = (int(n * rng.uniform(0.5, 1.0)) for n in (HEIGHT, WIDTH))
    y, x = int(rng.integers(picture.shape[0] - height)), int(rng.integers(picture.shape[1] - width))
    part = np.ascontiguousarray(picture[y : y + height, x : x + width])
    return np.asarray(cv2.resize(part, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC), np.uint8)


def _noise(rng: np.random.Generator) -> Grey:
    noise = rng.integers(0, 256, (HEIGHT, WIDTH)).astype(np.uint8)
    soft = np.asarray(cv2.GaussianBlur(noise, (0, 0), rng.uniform(0.5, 5.0)), np.float64)
    return _blurred(255.0 * (soft - soft.min()) / np.ptp(soft))


def _cells(rng: np.random.Generator) -> Grey:
    """A field of random black and white squares, turned."""
    cells = rng.integers(0, 2, (80, 100)).astype(np.uint8) * 255
    turn = np.array(cv2.getRotationMatrix2D((50, 40), rng.uniform(0, 90), rng.uniform(3, 14)), np.float64)
    turn[:, 2] += (WIDTH / 2 - 50, HEIGHT / 2 - 40)
    field = cv2.warpAffine(cells, turn, (WIDTH, HEIGHT), flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REFLECT)
    return _blurred(field)


def _false_codes(rng: np.random.Generator) -> Grey:
    """Random codes in black frames on white, as large as the families' own."""
    sheet = np.full((HEIGHT, WIDTH), 200, np.uint8)
    for _ in range(12):
        n = int(rng.integers(6, 11))
        code = np.pad(np.pad(rng.integers(0, 2, (n - 2, n - 2)), 1), 1, constant_values=1).astype(np.uint8)
        turn = np.array(cv2.getRotationMatrix2D((n / 2, n / 2), rng.uniform(0, 360), rng.uniform(2, 7)), np.float64)
        turn[:, 2] += rng.uniform((20, 20), (WIDTH - 20, HEIGHT - 20))
        picture = np.asarray(code * 220 + 15, np.uint8)
        cv2.warpAffine(
            picture, turn, (WIDTH, HEIGHT), sheet, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_TRANSPARENT
        )
    return _blurred(sheet)


def _shapes(rng: np.random.Generator) -> Grey:
    sheet = np.full((HEIGHT, WIDTH), int(rng.integers(256)), np.uint8)
    for _ in range(60):
        size = rng.integers(2, 40) * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        corners = rng.integers(0, WIDTH, (4, 2)) if rng.random() < 0.3 else rng.integers(0, WIDTH, 2) + size
        cv2.fillConvexPoly(sheet, corners.astype(np.int32), int(rng.integers(256)), cv2.LINE_AA)
    return _blurred(sheet)


def _blurred(picture: object) -> Grey:
    return np.asarray(cv2.GaussianBlur(np.asarray(picture, np.uint8), (0, 0), 0.6), np.uint8)
