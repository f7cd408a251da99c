"""Pictures drawn by several processes, each kept as soon as it is done, so that a later run goes on from there."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import shutil
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from multiprocessing import resource_tracker
from multiprocessing.connection import wait as wait_for
from pathlib import Path
from typing import Protocol

import cv2

from landtool.errors import LandtoolError
from landtool.io.atomic import Unfinished
from landtool.memory import keep_memory
from landtool.pad import PadSpec
from landtool.synth.dataset.request import DatasetRequest
from landtool.synth.dataset.rows import TruthRow, truth_row
from landtool.synth.domain import Domain
from landtool.synth.grounds import share_grounds
from landtool.synth.sample import Sample

_CHUNK = 8  # pictures a process is given at a time: small, as Ctrl-C waits for them
CLEAR = "clear"  # folder of the twins in clear air
_WAITING = 2  # chunks ready for each process


class Draw(Protocol):
    """Draws picture `index` of a seed; a function of a module, for it is sent to other processes by name."""

    def __call__(
        self,
        domain: Domain,
        pad: PadSpec,
        size: tuple[int, int],
        seed: int,
        index: int,
        photos: tuple[Path, ...],
        *,
        clear: bool = False,
    ) -> Sample:
        """Return the picture and its truth; the same arguments give the same bytes. clear: with its clear twin."""
        ...


@dataclass(frozen=True)
class Work:
    """Where pictures and what is true of them are put. split_of: the split of each picture, by its index."""

    request: DatasetRequest
    split_of: Sequence[str]
    place: Unfinished
    draw: Draw

    def image(self, index: int) -> str:
        """Return a picture's path relative to the dataset."""
        return f"images/{self.split_of[index]}/{self.request.stem(index)}.jpg"

    def twin(self, index: int) -> str:
        """Return the path of a picture's twin in clear air, relative to the dataset."""
        return f"{CLEAR}/{self.split_of[index]}/{self.request.stem(index)}.jpg"

    def is_done(self, index: int) -> bool:
        """Whether a picture, and its twin if it has one, is there as it was drawn."""
        try:
            digests = json.loads(self._note(index).read_bytes())["sha256"]
            # a machine that lost its power may have kept the names and lost the content
            return all(self._digest(name) == digest for name, digest in digests.items())
        except (OSError, ValueError):
            return False

    def row(self, index: int) -> TruthRow:
        """Return what is true of a picture that is done."""
        row: TruthRow = json.loads(self._note(index).read_bytes())["row"]
        return row

    def make(self, index: int) -> None:
        """Draw a picture and keep it, its note last: the note says that it is whole."""
        r = self.request
        sample = self.draw(r.domain, r.pad, r.size, r.seed, index, r.photo_paths, clear=r.clear)
        files = {self.image(index): sample.jpeg}
        if sample.clear is not None:
            files[self.twin(index)] = sample.clear
            (self.place.whole / self.twin(index)).parent.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            self._keep(self.place.whole / name, content)
        note = {
            "row": truth_row(self.image(index), self.split_of[index], sample.truth),
            "sha256": {name: hashlib.sha256(content).hexdigest() for name, content in files.items()},
        }
        self._keep(self._note(index), json.dumps(note).encode())

    def _digest(self, name: str) -> str:
        return hashlib.sha256((self.place.whole / name).read_bytes()).hexdigest()

    def _note(self, index: int) -> Path:
        return self.place.notes / f"{index}.json"

    def _keep(self, path: Path, content: bytes) -> None:
        # in the notes, which are thrown away: a killed process must leave nothing in the dataset
        temporary = self.place.notes / f"{os.getpid()}.part"
        try:
            temporary.write_bytes(content)
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


def draw_images(work: Work, indices: Sequence[int], jobs: int, on_images: Callable[[int], None]) -> None:
    """Make pictures in `jobs` processes; on_images is told how many more are done. At any exception all stop.

    Raises what drawing or writing raises, LandtoolError when a process is killed.
    """
    chunks = [indices[i : i + _CHUNK] for i in range(0, len(indices), _CHUNK)]
    jobs = min(jobs, len(chunks))
    if jobs <= 1:
        with _one_thread():
            for index in indices:
                work.make(index)
                on_images(1)
        return
    # fresh processes: one forked from a program with threads may hang
    context = multiprocessing.get_context("spawn")
    grounds = work.place.notes / "grounds"
    # a run that was killed may have left some that nobody finishes
    shutil.rmtree(grounds, ignore_errors=True)
    keep_signals_blocked()
    with ProcessPoolExecutor(jobs, context, initializer=begin_drawing, initargs=(grounds,)) as pool:
        try:
            for done in _all_done(pool, work, chunks, jobs * (1 + _WAITING)):
                on_images(done)
        except BrokenProcessPool as error:
            hint = "out of memory, perhaps: use fewer --jobs; the same call goes on from there"
            raise LandtoolError("a process that draws was killed", hint=hint) from error
        finally:
            pool.shutdown(cancel_futures=True)


def _all_done(pool: ProcessPoolExecutor, work: Work, chunks: Sequence[Sequence[int]], at_once: int) -> Iterator[int]:
    """Yield the sizes of chunks as they are done; only `at_once` are handed out, however many there are."""
    left = iter(chunks)
    running: set[Future[int]] = {pool.submit(_make_chunk, work, chunk) for chunk in islice(left, at_once)}
    while running:
        done, running = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            yield future.result()
        running |= {pool.submit(_make_chunk, work, chunk) for chunk in islice(left, len(done))}


def _make_chunk(work: Work, chunk: Sequence[int]) -> int:
    for index in chunk:
        work.make(index)
    return len(chunk)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Keep OpenCV to one thread, as in the other processes."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def keep_signals_blocked() -> None:
    """Start the helper process of the pool's now, and leave this thread's signals as they are.

    To start it multiprocessing blocks Ctrl-C and then unblocks it, also for a thread that had blocked it itself; the
    processes that draw would begin with it unblocked, and die of it while they load.
    """
    if hasattr(signal, "pthread_sigmask"):
        before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
        resource_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def begin_drawing(grounds: Path) -> None:
    """Set up a process that draws: Ctrl-C is its parent's to handle, and it ends when its parent does.

    grounds: folder in which the processes share what they all need.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    cv2.setNumThreads(1)
    keep_memory()
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()
    share_grounds(grounds)


def _end_with(sentinel: int) -> None:
    with suppress(OSError):
        wait_for([sentinel])
    os._exit(1)
