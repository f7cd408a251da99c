"""The generator: pictures a second, memory, where the time goes, truth of the tag's corners, correlations."""

from __future__ import annotations

import cProfile
import json
import pstats
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

import cv2
import numpy as np

import landtool
from bench.show import table
from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.synth.domain import Domain
from landtool.synth.make_sample import make_sample
from landtool.synth.preview import dataset_correlations
from landtool.tags.reader import ReaderConfig, TagReader
from tests.scenes import CLEAN_DOMAIN

SIZE = (640, 480)
TIMED = 600  # pictures: the start of the processes is in the time
PROFILED = 60
WARM = 40
CLEAN = 200
CORRELATED = 1120
SEED = 3
NEAR_PX = 6.0
LEAST_MARGIN_PX = 4.0  # between tag and border: a tag at the very border has no white around it
PAD = PadSpec()
# of the tag, shortest, pixels
SIDES = (
    ("all", 0.0, np.inf),
    ("< 16", 0.0, 16.0),
    ("16-30", 16.0, 30.0),
    ("30-60", 30.0, 60.0),
    ("> 60", 60.0, np.inf),
)

# Modules of landtool.synth by what they do, the first that fits; what is not named here is shown by its own name
STAGES = {
    "jpeg": ("jpeg",),
    "draw scene": (
        "make_sample",
        "random_scene",
        "domain",
        "viewpoint",
        "surroundings",
        "weather",
        "markings",
        "things",
        "signs",
    ),
    "ground": ("grounds", "floor"),
    "objects": ("compose", "scene", "faces", "raster", "surfaces", "decals", "mesh", "outlines"),
    "pad": ("print_layer", "sheet", "grime", "texture", "pad", "families"),
    "rays and lens": ("view", "camera", "geometry", "truth"),
    "shadow": ("shadow",),
    "fog": ("fog",),
    "motion blur": ("motion_blur", "photograph"),
    "sensor": ("sensor", "tone"),
}
JPEG_CALLS = ("imencode", "imdecode")

Profile = dict[tuple[str, int, str], tuple[int, int, float, float, dict[tuple[str, int, str], tuple[float, ...]]]]


def main() -> None:
    """Print all tables."""
    cv2.setNumThreads(1)
    _speed()
    _stages()
    _corners()
    _correlations()


def _speed() -> None:
    """Time the command as a user calls it, with one process and with two."""
    rows, digests, seconds = [], [], {}
    for jobs in (1, 2):
        with tempfile.TemporaryDirectory() as folder:
            output = Path(folder) / "set"
            seconds[jobs], peak_mb = _measured(_command(output, TIMED, jobs))
            digests.append(json.loads((output / "manifest.json").read_text())["files"])
        rate = TIMED / seconds[jobs]
        rows.append(
            [str(jobs), f"{rate:.1f}", f"{rate / jobs:.1f}", f"{seconds[1] / seconds[jobs]:.2f}", f"{peak_mb:.0f}"]
        )
    same = "the same bytes" if digests[0] == digests[1] else "NOT the same bytes"
    head = ["--jobs", "images/s", "a process", "times one", "peak MB, all processes"]
    table(
        f"landtool generate images -n {TIMED}, {SIZE[0]}x{SIZE[1]}, its start included; {same} either way", head, rows
    )


def _command(output: Path, n: int, jobs: int) -> list[str]:
    # `main`, not `run`: it is what keeps numpy's threads from fighting over the cores
    program = "from landtool_cli.main import main\nif __name__ == '__main__':\n    main()"
    size = f"{SIZE[0]}x{SIZE[1]}"
    flags = ["-o", str(output), "-n", str(n), "--seed", str(SEED), "--size", size, "--jobs", str(jobs), "--no-preview"]
    return [sys.executable, "-c", program, "generate", "images", *flags]


def _measured(command: list[str]) -> tuple[float, float]:
    """Return the seconds a command takes, and the most megabytes it and its children held together.

    It is asked again and again, as the kernel keeps a peak for every process alone (getrusage: the largest of them).
    """
    start, peak_kb = time.perf_counter(), 0
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while process.poll() is None:
            peak_kb = max(peak_kb, sum(map(_held_kb, _tree(process.pid))))
            time.sleep(0.2)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return time.perf_counter() - start, peak_kb / 1024.0


def _tree(pid: int) -> list[int]:
    try:
        tasks = [path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/children")]
    except OSError:  # it has ended meanwhile
        return []
    return [pid, *(inner for text in tasks for child in text.split() for inner in _tree(int(child)))]


def _held_kb(pid: int) -> int:
    """Return what a process holds: pages it shares with others count in shares."""
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith("Pss:")), 0)


def _stages() -> None:
    """Where the time of one picture goes, on one core."""
    for index in range(WARM):  # tables and textures that are made once
        make_sample(Domain(), PAD, SIZE, SEED + 1, index)
    start = time.process_time()
    for index in range(PROFILED):
        make_sample(Domain(), PAD, SIZE, SEED, index)
    plain_ms = 1e3 * (time.process_time() - start) / PROFILED
    profiler = cProfile.Profile(time.process_time)
    profiler.enable()
    for index in range(PROFILED):
        make_sample(Domain(), PAD, SIZE, SEED, index)
    profiler.disable()
    spent = _by_module(pstats.Stats(profiler).stats)  # type: ignore[attr-defined]
    by_stage: dict[str, dict[str, float]] = defaultdict(dict)
    for module, seconds in spent.items():
        by_stage[_stage_of(module)][module] = seconds
    total = sum(spent.values())
    rows = []
    for stage, modules in sorted(by_stage.items(), key=lambda item: -sum(item[1].values())):
        seconds = sum(modules.values())
        most = sorted(modules.items(), key=lambda item: -item[1])[:4]
        parts = ", ".join(f"{name} {1e3 * part / PROFILED:.1f}" for name, part in most)
        # the profiler slows everything down: its shares are of the time without it
        rows.append([stage, f"{plain_ms * seconds / total:.1f}", f"{100 * seconds / total:.0f}", parts])
    rows.append(["all", f"{plain_ms:.1f}", "100", ""])
    table(
        f"Processor time of a picture, ms; means of {PROFILED}", ["stage", "ms", "%", "most in (with profiler)"], rows
    )


def _by_module(profile: Profile) -> dict[str, float]:
    """Return the seconds spent in each module of landtool, with those of what it calls outside of landtool."""
    spent: dict[str, float] = defaultdict(float)
    for function, (_, _, own, _, _) in profile.items():
        for module, share in _shares(profile, function, ()).items():
            spent[module] += own * share
    return dict(spent)


def _shares(profile: Profile, function: tuple[str, int, str], above: tuple[object, ...]) -> dict[str, float]:
    """Return for whom a function works: its own module, or the modules of those who call it, by their calls' time."""
    file, _, name = function
    if any(call in name for call in JPEG_CALLS):
        return {"jpeg": 1.0}
    if module := _module(file):
        return {module: 1.0}
    callers = {c: times[2] + 1e-9 for c, times in profile[function][4].items() if c not in above and c != function}
    found: dict[str, float] = defaultdict(float)
    for caller, weight in callers.items():
        for module, share in _shares(profile, caller, (*above, function)).items():
            found[module] += share * weight / sum(callers.values())
    return dict(found) if found else {"other": 1.0}


def _module(file: str) -> str:
    """Return a module's name inside landtool.synth, or inside landtool, or nothing."""
    root = Path(landtool.__file__).parent
    path = Path(file)
    if not path.is_relative_to(root):
        return ""
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[1:] if parts[0] == "synth" else parts)


def _stage_of(module: str) -> str:
    fits = (s for s, modules in STAGES.items() if any(module == m or module.startswith(f"{m}.") for m in modules))
    return next(fits, module)


def _corners() -> None:
    """Corners of the tag as the library reads them in clean pictures against the truth."""
    reader = TagReader(ReaderConfig.of_pad(PAD))
    found: list[tuple[float, Array, Array]] = []
    with_tag = index = 0
    while with_tag < CLEAN:
        sample = make_sample(CLEAN_DOMAIN, PAD, SIZE, SEED, index)
        index += 1
        truth = sample.truth.tag_corners_px
        if truth is None or not _inside(truth):
            continue
        with_tag += 1
        for tag in reader.read_frame(sample.image):
            if np.linalg.norm(tag.corners_px.mean(axis=0) - truth.mean(axis=0)) < NEAR_PX:
                found.append((_side_px(truth), tag.corners_px - truth, truth))
                break
    rows = [_corner_row(name, found, low, high) for name, low, high in SIDES]
    head = ["side px", "read", "median px", "95 % px", "mean x", "mean y", "mean outwards", "median outwards"]
    table(f"Tag corners read against the truth, {len(found)} of {with_tag} clean pictures read", head, rows)


def _corner_row(name: str, found: list[tuple[float, Array, Array]], low: float, high: float) -> list[str]:
    kept = [(error, truth) for side, error, truth in found if low <= side < high]
    if not kept:
        return [name, "0", *["-"] * 6]
    errors = np.concatenate([error for error, _ in kept])
    away = np.concatenate([truth - truth.mean(axis=0) for _, truth in kept])
    # a tag drawn too large shows outwards, one drawn beside its place in x and y
    outwards = (errors * away).sum(axis=1) / np.linalg.norm(away, axis=1)
    size = np.linalg.norm(errors, axis=1)
    values = (np.median(size), np.percentile(size, 95), *errors.mean(axis=0), outwards.mean(), np.median(outwards))
    return [name, str(len(kept)), *(f"{value:.3f}" for value in values[:2]), *(f"{value:+.3f}" for value in values[2:])]


def _inside(corners_px: Array) -> bool:
    """Whether a tag can be read: all of it in the picture, of 1.5 pixels a module or more."""
    low, high = LEAST_MARGIN_PX, np.array(SIZE) - 1.0 - LEAST_MARGIN_PX
    return bool((corners_px >= low).all() and (corners_px <= high).all() and _side_px(corners_px) >= 12.0)


def _side_px(corners_px: Array) -> float:
    """Return the shortest side."""
    return float(np.linalg.norm(corners_px - np.roll(corners_px, 1, axis=0), axis=1).min())


def _correlations() -> None:
    """What goes with the pad's size in a whole data set."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "set"
        subprocess.run(_command(output, CORRELATED, 2), check=True, capture_output=True)
        rows = dataset_correlations(output)
    cells = [
        [row.name, f"{row.coefficient:+.3f}", f"{row.coefficient / row.chance:+.1f}", str(row.count)] for row in rows
    ]
    largest = max(rows, key=lambda row: abs(np.nan_to_num(row.coefficient)))
    title = f"Correlation with the logarithm of the pad's size; largest: {largest.name} {largest.coefficient:+.3f}"
    table(title, ["of", "coefficient", "in standard deviations of chance", "pictures"], cells)
