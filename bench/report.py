"""Time and size of `landtool report`: the page of a run of 640x480 pixels at 30 frames a second."""

from __future__ import annotations

import tempfile
import time
from fractions import Fraction
from pathlib import Path

import numpy as np

from bench.show import table
from landtool.geometry import Pose
from landtool.io.run_record import Counts, HashedFile, RunRecord, StageTime, write_run
from landtool.io.tables import TABLES, TableWriter
from landtool.io.video_out import VideoWriter
from landtool.report.facts import facts
from landtool.report.html.write import write_report
from landtool.report.verdict import VerdictLog
from landtool.types import FrameResult, PadPose, Prediction, Track

FPS, WIDTH, HEIGHT = 30, 640, 480
ROUNDS = 3
GOAL_S, GOAL_MB = 3.0, 3.0  # of a minute, without the video's own bytes
HORIZONS_S = (0.1, 0.25, 0.5, 1.0)


def main() -> None:
    """Print the table."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for seconds, videos in ((60, ("none", "embed")), (600, ("none",))):
            run = Path(name) / f"run{seconds}"
            _write(run, seconds, film=seconds == 60)
            for video in videos:
                took, size = _best(run, Path(name) / "report.html", video)
                own = size - (_encoded(run / "annotated.mp4") if video == "embed" else 0)
                sizes = f"{size / 1e6:.2f}", f"{own / 1e6:.2f}"
                rows.append((f"{seconds} s", seconds * FPS, video, f"{took:.2f}", *sizes))
    head = ("run", "frames", "video", f"best of {ROUNDS}, s", "page, MB", "without video, MB")
    table(f"landtool report, {WIDTH}x{HEIGHT}; goals of 60 s: {GOAL_S:g} s, {GOAL_MB:g} MB without video", head, rows)


def _best(run: Path, output: Path, video: str) -> tuple[float, int]:
    took = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        made = write_report(run, output, video=video, overwrite=True)  # type: ignore[arg-type]
        took.append(time.perf_counter() - start)
    return min(took), made.bytes


def _encoded(path: Path) -> int:
    return -(-path.stat().st_size // 3) * 4  # base64


def _write(folder: Path, seconds: int, *, film: bool) -> None:
    """Write a run's folder as `landtool track` would: noisy measurements, some lost, and where asked for a video."""
    folder.mkdir()
    rng = np.random.default_rng(7)
    log = VerdictLog(0.5)
    results = [_result(i, seconds * FPS, rng) for i in range(seconds * FPS)]
    for name, columns in TABLES.items():
        with TableWriter(folder / name, columns) as writer:
            for result in results:
                writer.write(result)
    for result in results:
        log.add(result)
    if film:
        _write_video(folder / "annotated.mp4", results, rng)
    times = {name: StageTime(1.0, len(results)) for name in ("detect", "tags", "target", "track", "write")}
    verdict = {**facts(log.verdict(), wall_s=1.0, switch_altitude_m=None), "lines": ["landing: made up"]}
    counts = Counts(len(results), len(results), 0, 0, 0, len(results))
    inputs = (HashedFile("clip.mp4", "0" * 64),)
    write_run(folder, RunRecord("track", {}, inputs, counts, 0, timings=times, verdict=verdict))


def _write_video(path: Path, results: list[FrameResult], rng: np.random.Generator) -> None:
    """Write a flight over a ground of coarse squares."""
    ground = rng.integers(40, 200, (HEIGHT // 8 + 8, WIDTH // 8 + 8, 3), np.uint8).repeat(8, 0).repeat(8, 1)
    with VideoWriter(path, WIDTH, HEIGHT, Fraction(1, FPS), quick=True) as video:
        for i, result in enumerate(results):
            x, y = i % 64, (i // 3) % 64
            video.write(np.ascontiguousarray(ground[y : y + HEIGHT, x : x + WIDTH]), result.t_ns)


def _result(i: int, count: int, rng: np.random.Generator) -> FrameResult:
    t_ns = round(i * 1e9 / FPS)
    t_s = i / FPS
    height_m = 20.0 - 19.0 * i / count
    place = np.array([2.0 * t_s, np.sin(t_s), 0.0])
    place[:2] += rng.normal(0.0, 0.01, 2)
    drone = Pose(np.eye(3), place + [*rng.normal(0.0, 0.2, 2), height_m])
    pad = Pose(np.eye(3), place)
    seen = rng.random() > 0.1
    found = {}
    if seen:
        camera_T_pad = Pose(np.eye(3), np.array([0.0, 0.0, height_m]))
        pose = PadPose(camera_T_pad, np.eye(6) * 1e-4, "tag" if height_m < 6.0 else "target", 0.1, 0.2)
        found = {"pose": pose, "body_T_pad": drone.inverse() @ pad, "world_T_pad": pad}
    ahead = tuple(
        Prediction(h, np.array([2.0 * (t_s + h), np.sin(t_s)]) + rng.normal(0.0, 0.05, 2), np.eye(2) * 0.01)
        for h in HORIZONS_S
    )
    state = np.array([*place[:2], 2.0, np.cos(t_s)])
    track = Track(
        1, "confirmed" if seen else "coasting", "world", state, np.eye(4) * 0.01, 1.0, 0.5, ahead[2].xy_m, ahead
    )
    stage = "near" if height_m < 5.0 else "far"
    reason = "" if seen else "nothing of the pad found"
    return FrameResult(i, t_ns, reason=reason, stage=stage, search="region", haze=0.1, tracks=(track,), **found)  # type: ignore[arg-type]
