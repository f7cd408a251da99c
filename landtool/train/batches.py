"""Batches, each made from its number alone, so that a training can go on where it stopped."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.darknet.network import Network
from landtool.geometry import Array
from landtool.train.augment import degraded, four, part, recoloured, whole
from landtool.train.samples import Example, Samples
from landtool.train.settings import TrainSettings

_AHEAD = 3  # batches made before they are needed
_OF_ONE_SIZE = 10  # iterations, as in darknet: every change costs the arithmetic's set-up anew


@dataclass(frozen=True, eq=False)
class Batch:
    """What a step learns from.

    pictures: (B, H, W, 3) RGB uint8. boxes: (N, 4) float32 cx, cy, w, h in pixels. picture, label: (N,) int64, which
    one of the batch a box is in, and its class. ignored: (N,) bool.
    """

    iteration: int
    pictures: NDArray[np.uint8]
    boxes: NDArray[np.float32]
    picture: NDArray[np.int64]
    label: NDArray[np.int64]
    ignored: NDArray[np.bool_]


class BatchMaker:
    """Makes the batches of a training."""

    def __init__(self, samples: Samples, network: Network, settings: TrainSettings) -> None:
        self._samples, self._network, self._settings = samples, network, settings

    def batch(self, iteration: int) -> Batch:
        """Return the batch of an iteration, counted from 0: the same one, whatever was made before."""
        settings = self._settings
        rng = np.random.default_rng([settings.seed, 1, iteration // _OF_ONE_SIZE])
        is_whole = bool(rng.random() < settings.whole)
        side = int(rng.choice(settings.sides)) if settings.sides else 0
        size = (side, side)
        if is_whole:
            size = (self._network.width, self._network.height)
            size = self._network.half_size(*size) if self._network.pyramid and rng.random() < 0.5 else size
        examples = []
        for slot in range(settings.batch):
            own = np.random.default_rng([settings.seed, 2, iteration, slot])
            examples.append(self._example(iteration, size, is_whole, own))
        return _batch(iteration, examples)

    def ahead(self, start: int, stop: int, workers: int = 1) -> Generator[Batch]:
        """Yield the batches of a range of iterations, made in other threads a little before they are asked for."""
        with ThreadPoolExecutor(workers, thread_name_prefix="batches") as pool:
            waiting: deque[Future[Batch]] = deque()
            try:
                for iteration in range(start, stop):
                    waiting.append(pool.submit(self.batch, iteration))
                    if len(waiting) > _AHEAD:
                        yield waiting.popleft().result()
                while waiting:
                    yield waiting.popleft().result()
            finally:
                for future in waiting:
                    future.cancel()

    def _example(self, iteration: int, size: tuple[int, int], is_whole: bool, rng: np.random.Generator) -> Example:
        settings = self._settings
        first = self._drawn(iteration, rng)
        if is_whole:
            shown = whole(first, *size, settings, rng)
        elif rng.random() < settings.mosaic:
            others = [self._drawn(iteration, rng) for _ in range(3)]
            shown = four([part(e, *size, settings, rng) for e in (first, *others)], *size, rng)
        else:
            shown = part(first, *size, settings, rng)
        image = recoloured(shown.image, settings, rng)
        image = degraded(image, rng) if rng.random() < settings.degrade else image
        return Example(image, shown.boxes, shown.labels, shown.ignored)

    def _drawn(self, iteration: int, rng: np.random.Generator) -> Example:
        pool = self._samples.pool(iteration)
        return self._samples.example(pool[int(rng.integers(len(pool)))])


def _batch(iteration: int, examples: list[Example]) -> Batch:
    pictures = np.empty((len(examples), *examples[0].image.shape), np.uint8)
    for picture, example in zip(pictures, examples, strict=True):
        cv2.cvtColor(example.image, cv2.COLOR_BGR2RGB, dst=picture)
    boxes: Array = np.concatenate([example.boxes for example in examples])
    centred = np.column_stack([(boxes[:, :2] + boxes[:, 2:]) / 2.0, boxes[:, 2:] - boxes[:, :2]])
    counts = [len(example.boxes) for example in examples]
    return Batch(
        iteration,
        pictures,
        centred.astype(np.float32).reshape(-1, 4),
        np.repeat(np.arange(len(examples)), counts),
        np.concatenate([example.labels for example in examples]),
        np.concatenate([example.ignored for example in examples]),
    )
