"""Time of dehazing a frame, one thread, against the textbook's way and against a copy of the frame."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from bench.dehaze_pairs import FOGGY, SEED
from bench.detect_sets import PAD
from bench.show import table
from bench.textbook import textbook
from landtool.dehaze.config import DehazeConfig
from landtool.dehaze.stage import DehazeStage
from landtool.synth.fog_pair import make_fog_pair
from landtool.types import Frame, Image

INDEX = 3  # of the scene: thick fog, where noise must be kept down
SIZES = ((640, 480), (1920, 1080))
GOALS_MS = {(640, 480): 5.0, (1920, 1080): 30.0}
ROUNDS = 15
FRAME_NS = 33_333_333


def print_speed() -> None:
    """Print the processor time a frame of every way, measured in turns."""
    rows = []
    for size in SIZES:
        pair = make_fog_pair(FOGGY, PAD, size, SEED, INDEX)
        assert pair is not None
        times = _timed(pair.foggy)
        for name, spent_ms in times.items():
            less, more = times["textbook, dense"] / spent_ms, spent_ms / times["cv2.copyTo"]
            rows.append(["x".join(map(str, size)), name, f"{spent_ms:.2f}", f"{less:.1f}", f"{more:.1f}"])
    goals = ", ".join(f"{goal:g} ms at {w}x{h}" for (w, h), goal in GOALS_MS.items())
    head = ["size", "way", "ms", "times faster than textbook", "times a copy"]
    said = f"Processor time a frame, one thread, median of {ROUNDS} rounds, in turns"
    table(f"{said}; goals for veil: {goals}, 8 times faster", head, rows)


def _timed(image: Image) -> dict[str, float]:
    """Return the median time of each way, ms; a round more warms up."""
    everything: Any = None  # no mask: the stubs want one
    ways: dict[str, Callable[[int], object]] = {
        "textbook, dense": lambda _: textbook(image),
        "paper": _stage(image, DehazeConfig(recipe="paper")),
        "veil": _stage(image, DehazeConfig()),
        "cv2.copyTo": lambda _: cv2.copyTo(image, everything),
    }
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for turn in range(ROUNDS + 1):
        for name, call in ways.items():
            start = time.thread_time()
            call(turn)
            spent[name].append(1e3 * (time.thread_time() - start))
    return {name: float(np.median(times[1:])) for name, times in spent.items()}


def _stage(image: Image, config: DehazeConfig) -> Callable[[int], object]:
    stage = DehazeStage(config, when="on")
    return lambda turn: stage.see(Frame(turn, turn * FRAME_NS, image)).image
