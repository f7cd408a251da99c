"""Speed of the whole of `landtool track`: near and far, with and without annotated video, with and without dehazing.

Every way is run several times in turn and its best run counts, so that what else the machine does costs all the same.
"""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from fractions import Fraction
from importlib import resources
from pathlib import Path

import cv2
import numpy as np
import onnxruntime
from numpy.typing import NDArray

from bench.show import table
from landtool.detect.config import DetectorConfig
from landtool.detect.detector import SHIPPED_MODEL, Detector
from landtool.io.video import VideoSource
from landtool.io.video_out import VideoWriter
from landtool.types import Frame

ROUNDS = 4
NEAR_M, FAR_M = 4.0, 8.0  # where the near clip begins and the far one ends
GOALS_FPS = {"csv": 120, "video,csv": 60}
GOAL_FAR = 1.25  # times the bare inference
BARE_RUNS = 20
_SPEED = re.compile(r"frames/s over ([0-9.]+) s")
_TRACK = "from landtool_cli.main import main; main()"


@dataclass(frozen=True)
class Clip:
    """A recording; its camera and pad lie beside it, under the name of the generated clip it comes from."""

    name: str
    path: Path
    generated: Path

    @property
    def options(self) -> list[str]:
        """What `landtool track` needs to know of it."""
        return ["--camera", str(self.generated.with_suffix(".camera.yaml"))] + [
            "--pad",
            str(self.generated.with_suffix(".pad.toml")),
        ]


@dataclass(frozen=True)
class Run:
    """One run of the command. frame_ms: wall time a frame of all of it. stages_ms: of each stage, mean a frame."""

    frame_ms: float
    stages_ms: dict[str, float]


@dataclass(frozen=True)
class Way:
    """A clip, what is saved of it, and how it is dehazed."""

    clip: Clip
    save: str
    dehaze: str = "auto"


def main() -> None:
    """Print all tables."""
    with tempfile.TemporaryDirectory() as folder:
        near, far = _near(Path(folder)), _far(Path(folder))
        ways = [Way(near, "csv"), Way(near, "video,csv"), Way(far, "csv"), Way(far, "video,csv")]
        ways += [Way(clip, "csv", dehaze) for clip in (near, far) for dehaze in ("off", "on")]
        best, bare_ms = _timed(ways, Path(folder))
    _print_stages(best)
    _print_far(best, far, bare_ms)
    _print_dehaze(best, (near, far))


def _near(folder: Path) -> Clip:
    path = _generated(folder / "near.mp4", NEAR_M, 60, 10)
    return Clip("near", path, path)


def _far(folder: Path) -> Clip:
    """Make a clip of an approach from 20 m that ends at `FAR_M`."""
    whole, path = _generated(folder / "approach.mp4", 20.0, 30, 10), folder / "far.mp4"
    with whole.with_suffix(".truth.csv").open(newline="") as file:
        places = [float(row["camera_T_pad_z_m"]) for row in csv.DictReader(file)]
    count = next(i for i, z in enumerate(places) if z < FAR_M)
    with VideoSource(whole) as source:
        info = source.info
        with VideoWriter(path, info.width, info.height, info.time_base or Fraction(1, 15360)) as video:
            for frame, _ in zip(source, range(count), strict=False):
                assert isinstance(frame, Frame)
                video.write(frame.image, frame.t_ns)
    return Clip("far", path, whole)


def _generated(path: Path, height_m: float, fps: int, duration_s: int) -> Path:
    options = {"--height": height_m, "--fps": fps, "--duration": duration_s, "-o": path}
    _landtool("generate", "clip", "-q", *(str(part) for pair in options.items() for part in pair))
    return path


def _landtool(*arguments: str) -> str:
    command = [sys.executable, "-c", _TRACK, *arguments]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def _timed(ways: list[Way], folder: Path) -> tuple[dict[Way, Run], float]:
    """Return the best run of every way, and the best time of a bare inference, ms."""
    best: dict[Way, Run] = {}
    bare_ms = np.inf
    session, tensor = _bare()
    name = session.get_inputs()[0].name
    for turn in range(ROUNDS):
        for k in range(len(ways)):
            way = ways[(k + turn) % len(ways)]
            run = _run(way, folder / "out")
            if way not in best or run.frame_ms < best[way].frame_ms:
                best[way] = run
            for _ in range(BARE_RUNS):
                start = time.perf_counter()
                session.run(None, {name: tensor})
                bare_ms = min(bare_ms, 1e3 * (time.perf_counter() - start))
    return best, float(bare_ms)


def _run(way: Way, folder: Path) -> Run:
    chosen = ["--save", way.save, "--dehaze", way.dehaze, "-o", str(folder), "--overwrite", "-q"]
    said = _landtool("track", str(way.clip.path), *way.clip.options, *chosen)
    record = json.loads((folder / way.clip.path.stem / "run.json").read_text())
    spent = _SPEED.search(said)
    assert spent is not None, said
    stages = {stage: float(times["mean_ms"]) for stage, times in record["timings"].items()}
    return Run(1e3 * float(spent[1]) / record["counts"]["written"], stages)


def _bare() -> tuple[onnxruntime.InferenceSession, NDArray[np.float32]]:
    """Return the shipped network, one thread, and an input of its size."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    file = Path(str(resources.files("landtool"))) / "models" / SHIPPED_MODEL
    session = onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
    picture = np.random.default_rng(0).integers(0, 256, (480, 640, 3), np.uint8)
    size = Detector(DetectorConfig()).imgsz
    return session, np.asarray(cv2.dnn.blobFromImage(picture, 1.0 / 255.0, size, swapRB=True), np.float32)


def _print_stages(best: dict[Way, Run]) -> None:
    rows: list[list[str]] = []
    stages = sorted({stage for run in best.values() for stage in run.stages_ms})
    for way, run in sorted(best.items(), key=lambda item: (item[0].clip.name, item[0].save, item[0].dehaze)):
        goal = str(GOALS_FPS[way.save]) if way.clip.name == "near" and way.dehaze == "auto" else ""
        times = [f"{run.stages_ms[stage]:.2f}" if stage in run.stages_ms else "" for stage in stages]
        rows.append([way.clip.name, way.save, way.dehaze, f"{1e3 / run.frame_ms:.0f}", goal, *times])
    said = f"Whole `landtool track`, 640x480, best of {ROUNDS} rounds in turns; stages: wall time a frame, ms"
    table(said, ["clip", "saved", "dehaze", "frames/s", "goal", *stages], rows)


def _print_far(best: dict[Way, Run], far: Clip, bare_ms: float) -> None:
    rows = [
        [way.save, f"{run.frame_ms:.2f}", f"{bare_ms:.2f}", f"{run.frame_ms / bare_ms:.2f}"]
        for way, run in best.items()
        if way.clip is far and way.dehaze == "auto"
    ]
    said = f"Far stage, above {FAR_M:g} m: wall time a frame of the whole command against the bare network, one thread"
    table(f"{said}; goal {GOAL_FAR:g} with video", ["saved", "ms", "bare ms", "ratio"], rows)


def _print_dehaze(best: dict[Way, Run], clips: tuple[Clip, ...]) -> None:
    rows = []
    for clip in clips:
        off, on = best[Way(clip, "csv", "off")], best[Way(clip, "csv", "on")]
        more, own = on.frame_ms - off.frame_ms, on.stages_ms["dehaze"]
        rows.append([clip.name, f"{off.frame_ms:.2f}", f"{on.frame_ms:.2f}", f"{more:.2f}", f"{own:.2f}"])
    head = ["clip", "off ms", "on ms", "difference", "own stage"]
    table("What dehazing adds to a frame of the whole command, and its own stage's time", head, rows)
