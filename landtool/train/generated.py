"""Training straight from the generator: pictures drawn in other processes while the network learns, kept in memory."""

from __future__ import annotations

import math
import multiprocessing
import threading
from collections import deque
from collections.abc import Sequence
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Self

import cv2
import numpy as np

from landtool.errors import LandtoolError, UsageError
from landtool.geometry import Array
from landtool.io.labels import LabelledBox, LabelledImage
from landtool.pad import PadSpec
from landtool.synth.dataset.work import Draw, begin_drawing, keep_signals_blocked
from landtool.synth.domain import Domain
from landtool.synth.make_sample import make_sample
from landtool.train.samples import Example

_AHEAD = 20  # iterations whose new pictures are drawn before any step may use them
_WAITING = 1  # pictures ready for the processes: few, as one that a step waits for comes after them


@dataclass(frozen=True, eq=False)
class GeneratedPicture:
    """A picture as the content of its .jpg file; box_px: (4,) of the pad in OpenCV pixels, None where there is none."""

    jpeg: bytes
    box_px: Array | None

    def example(self) -> Example:
        """Return it decoded."""
        image = cv2.imdecode(np.frombuffer(self.jpeg, np.uint8), cv2.IMREAD_COLOR)
        boxes = np.empty((0, 4)) if self.box_px is None else self.box_px[None] + 0.5
        return Example.of(np.asarray(image, np.uint8), boxes, [0] * len(boxes))


@dataclass(frozen=True)
class _What:
    """What all pictures have in common."""

    draw: Draw
    domain: Domain
    pad: PadSpec
    size: tuple[int, int]
    photos: tuple[Path, ...]


class GeneratedSamples:
    """Pictures of a seed, drawn as a training comes to need them; a context manager, which stops the processes.

    first: pictures there are to begin with. fresh: new ones an iteration. keep: how many of the newest a step draws
    from, all of which are held in memory. jobs: processes that draw. The pictures and which of them a step may use
    depend on nothing else, so that a resumed training sees the same: what it needs of the old ones is drawn again.
    draw: what draws a picture.

    Raises UsageError for numbers that leave nothing to learn from; `example` and `labelled` raise what drawing raises,
    LandtoolError when a process was killed.
    """

    def __init__(
        self,
        domain: Domain,
        pad: PadSpec,
        size: tuple[int, int],
        seed: int,
        photos: Sequence[Path] = (),
        *,
        first: int,
        fresh: float,
        keep: int,
        jobs: int,
        draw: Draw = make_sample,
    ) -> None:
        for name, value in (("first", first), ("keep", keep), ("jobs", jobs)):
            if value < 1:
                raise UsageError(f"{name} = {value} leaves nothing to learn from", hint="give 1 or more")
        if not 0.0 <= fresh < math.inf:
            raise UsageError(f"fresh = {fresh:g} is impossible", hint="give 0 or more")
        self._what = _What(draw, domain, pad, size, tuple(photos))
        self._size, self._seed = size, seed
        self._first, self._fresh, self._keep, self._jobs = first, fresh, keep, jobs
        # all below is shared by threads, and touched with `_changed` held only
        self._changed = threading.Condition()
        self._pictures: dict[int, Future[GeneratedPicture]] = {}
        self._asked: deque[tuple[int, int, Future[GeneratedPicture]]] = deque()
        self._latest, self._next, self._closed = -1, 0, False

    def __enter__(self) -> Self:
        keep_signals_blocked()
        self._grounds = TemporaryDirectory(prefix="landtool-", ignore_cleanup_errors=True)
        # fresh processes: one forked from a program with threads may hang
        context = multiprocessing.get_context("spawn")
        told = Path(self._grounds.name), self._what
        self._pool = ProcessPoolExecutor(self._jobs, context, initializer=_begin, initargs=told)
        count = self._jobs + _WAITING
        self._threads = [threading.Thread(target=self._serve, name="generated", daemon=True) for _ in range(count)]
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        with self._changed:
            self._closed = True
            for _, _, future in self._asked:
                future.cancel()
            self._asked.clear()
            self._changed.notify_all()
        self._pool.shutdown(cancel_futures=True)
        for thread in self._threads:
            thread.join()
        self._grounds.cleanup()

    def pool(self, iteration: int) -> range:
        """Return the numbers of the newest pictures there are at an iteration; they begin to be drawn."""
        pool = self._range(iteration)
        with self._changed:
            if iteration > self._latest:
                for index in range(self._range(max(self._latest, 0)).start, pool.start):
                    self._pictures.pop(index, None)
                self._latest = iteration
                self._changed.notify_all()
        return pool

    def example(self, index: int) -> Example:
        """Return a picture as soon as it is drawn; one that is waited for goes before the others."""
        with self._changed:
            future = self._pictures.get(index)
            if future is None:
                future = self._ask(self._seed, index)
                if index >= self._range(max(self._latest, 0)).start:  # an older one is used once more at most
                    self._pictures[index] = future
        return future.result().example()

    def labelled(self, seed: int, count: int) -> tuple[list[LabelledImage], list[Example]]:
        """Return the first pictures of another seed, to validate on, when all are drawn; paths are names only."""
        with self._changed:
            futures = [self._ask(seed, index) for index in range(count)]
        pictures = [future.result() for future in futures]
        images = [
            LabelledImage(Path(f"generated-{seed}-{index:06d}.jpg"), *self._size, _boxes(picture))
            for index, picture in enumerate(pictures)
        ]
        return images, [picture.example() for picture in pictures]

    def _range(self, iteration: int) -> range:
        high = self._first + math.floor(self._fresh * iteration)
        return range(max(0, high - self._keep), high)

    def _ask(self, seed: int, index: int) -> Future[GeneratedPicture]:
        if self._closed:
            raise CancelledError
        future: Future[GeneratedPicture] = Future()
        self._asked.append((seed, index, future))
        self._changed.notify()
        return future

    def _serve(self) -> None:
        """Have one picture after the other drawn, until all is over."""
        while (task := self._take()) is not None:
            seed, index, future = task
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(self._pool.submit(_draw, seed, index).result())
            except BrokenProcessPool as error:
                killed = LandtoolError("a process that draws was killed", hint="out of memory, perhaps: use fewer jobs")
                killed.__cause__ = error
                future.set_exception(killed)
            except BaseException as error:  # it is for whoever waits for the picture
                future.set_exception(error)

    def _take(self) -> tuple[int, int, Future[GeneratedPicture]] | None:
        """Return what to draw next: what is waited for, else the oldest that steps may use soon. None: no more."""
        with self._changed:
            while not self._closed:
                if self._asked:
                    return self._asked.popleft()
                if (index := self._unasked()) is not None:
                    future = self._pictures[index] = Future()
                    return self._seed, index, future
                self._changed.wait()
        return None

    def _unasked(self) -> int | None:
        if self._latest < 0:
            return None
        self._next = max(self._next, self._range(self._latest).start)
        while self._next in self._pictures:
            self._next += 1
        return self._next if self._next < self._range(self._latest + _AHEAD).stop else None


def _boxes(picture: GeneratedPicture) -> tuple[LabelledBox, ...]:
    if picture.box_px is None:
        return ()
    x_min, y_min, x_max, y_max = (float(edge) for edge in picture.box_px)
    return (LabelledBox(0, x_min, y_min, x_max, y_max),)


# what a process that draws was told when it began
_told: list[_What] = []


def _begin(grounds: Path, what: _What) -> None:
    begin_drawing(grounds)
    _told.append(what)


def _draw(seed: int, index: int) -> GeneratedPicture:
    what = _told[-1]
    sample = what.draw(what.domain, what.pad, what.size, seed, index, what.photos)
    return GeneratedPicture(sample.jpeg, sample.truth.box_px)
