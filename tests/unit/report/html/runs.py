"""Made-up runs and evaluations in folders, as `landtool track` and `landtool eval` write them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from landtool.io.run_record import Counts, HashedFile, RunRecord, StageTime, write_run
from landtool.io.tables import TABLES, TableWriter
from landtool.io.video_out import VideoWriter
from landtool.report.facts import facts
from landtool.report.verdict import VerdictLog
from landtool.report.words import verdict_lines
from landtool.types import FrameResult
from tests.unit.report.landings import FPS, HORIZON_S, STEP_NS, measured, result, track

SPEED_MPS = 2.0
SIZE_PX = (160, 120)


def landing(frames: int = 60, *, gap: range = range(0), clock: bool = True) -> list[FrameResult]:
    """A descent from 6 m over a platform that drives along x at 2 m/s; in the gap the pad is not seen."""
    rows = []
    for i in range(frames):
        x_m = SPEED_MPS * i / FPS
        said: dict[str, Any] = {"t_ns": i * STEP_NS if clock else None, "stage": "far" if i < frames // 3 else "near"}
        if clock:
            ahead = (x_m + SPEED_MPS * HORIZON_S + 0.01 * i, 0.0)
            state = "tentative" if i < 2 else "coasting" if i in gap else "confirmed"
            said["tracks"] = (track((x_m, 0.0), ahead, state, nis=1.0, sigma_m=0.05),)
        if i in gap:
            rows.append(result(i, reason="nothing of the pad found", **said))
            continue
        height_m = 6.0 - 5.0 * i / max(1, frames)
        method = "target" if i < frames // 3 else "tag"
        rows.append(measured(i, height_m, method, drone_m=(x_m + 0.3, 0.1), pad_m=(x_m, 0.0), **said))
    return rows


def write_landing(
    folder: Path,
    rows: Sequence[FrameResult],
    *,
    name: str = "flight.mp4",
    tables: Iterable[str] = tuple(TABLES),
    video: bool = True,
    notes: tuple[str, ...] = (),
    start_ns: int = 0,
    save: tuple[str, ...] | None = None,
) -> Path:
    """Write a run's folder; returns it.

    start_ns: added to the video's times only, as of a clip with a late start. save: what its record says was saved.
    """
    folder.mkdir(parents=True, exist_ok=True)
    log = VerdictLog(0.5)
    for row in rows:
        log.add(row)
    for table in tables:
        with TableWriter(folder / table, TABLES[table]) as writer:
            for row in rows:
                writer.write(row)
    if video and rows:
        write_video(folder / "annotated.mp4", [row for row in rows if row.stage is not None], start_ns)
    said = facts(log.verdict(), wall_s=2.0, switch_altitude_m=None)
    lines = verdict_lines(log.verdict(), diameter_m=1.0, switch_altitude_m=None)
    record = RunRecord(
        command="track",
        config={"camera": None, **({} if save is None else {"save": list(save)}), "tracker": {"horizon_s": HORIZON_S}},
        inputs=(HashedFile(name, "ab" * 32),),
        counts=Counts(len(rows), len(rows), 0, 0, 0, len(rows)),
        exit_code=0,
        timings={"detect": StageTime(0.5, 20), "tags": StageTime(0.2, len(rows))},
        notes=notes,
        verdict={**said, "lines": lines},
    )
    write_run(folder, record)
    return folder


def write_video(path: Path, rows: Sequence[FrameResult], start_ns: int = 0) -> None:
    """Write a picture a frame, its grey level the frame's number times two."""
    width, height = SIZE_PX
    with VideoWriter(path, width, height, Fraction(1, FPS), quick=True) as video:
        for i, row in enumerate(rows):
            picture = np.full((height, width, 3), 20 + 2 * (row.index % 100), np.uint8)
            video.write(picture, (i * STEP_NS if row.t_ns is None else row.t_ns) + start_ns)


def metric(stage: str, name: str, value: float | None, count: int, of: int, **changes: Any) -> dict[str, Any]:
    """One number of metrics.json."""
    low, high = (None, None) if value is None else (value * 0.9, value * 1.1)
    base = {"model": "shipped", "stage": stage, "name": name, "slice": "", "value": value, "low": low, "high": high}
    return {**base, "better": "higher", "expected": None, "count": count, "of": of, **changes}


def gate_row(key: str, baseline: float | None, value: float | None, verdict: str, **changes: Any) -> dict[str, Any]:
    """One number the gate compared, in metrics.json."""
    row = {"key": key, "baseline": baseline, "value": value, "low": None, "high": None, "by": None}
    return {**row, "tolerance": None if value is None else 0.02, "verdict": verdict, **changes}


GATE = {
    "passed": False,
    "baseline": "baseline.json",
    "rows": [
        gate_row("tags.read", 0.9, 0.9, "same", by=0.0),
        gate_row("pose.place_percent_median", 0.5, None, "gone"),
        gate_row("pose.normal_deg_median", 0.5, 0.53, "worse", by=0.03),
        gate_row("detection.map50", 0.95, 0.7, "worse", by=0.25, low=0.6, high=0.8),
    ],
}


def write_evaluation(
    folder: Path, *, name: str = "fixtures", metrics: Sequence[Any] | None = None, **keys: Any
) -> Path:
    """Write an evaluation's folder of two models, one clip and some stills; returns it."""
    folder.mkdir(parents=True, exist_ok=True)
    numbers = [
        metric("detection", "map50", 0.953, 120, 126),
        metric("detection", "map50", 0.9, 120, 126, model="other"),
        metric("detection", "recall", 0.8, 12, 15, slice="size_px=14-20"),
        metric("pose", "place_percent_median", None, 0, 0, better="lower"),
        metric("track", "nees_over_dof", 1.1, 50, 60, better="expected", expected=1.0),
    ]
    record = {
        "format_version": 1,
        "command": "eval",
        "versions": {"landtool": "0.1.0"},
        "dataset": {"name": name, "digest": "cd" * 32, "parts": [{"name": "straight", "kind": "clip", "frames": 60}]},
        "config": {"stages": ["detection"]},
        "models": [
            {"name": "shipped", "file": "a.onnx", "sha256": "00"},
            {"name": "other", "file": "b.onnx", "sha256": "11"},
        ],
        "metrics": numbers if metrics is None else list(metrics),
        "curves": [{"model": "shipped", "score": [0.9, 0.5], "precision": [1.0, 0.8], "recall": [0.5, 0.9]}],
        "speed": [{"model": "shipped", "stage": "detect", "frames": 10, "seconds": 0.3}],
        "notes": [],
        "gate": None,
        "exit_code": 0,
        **keys,
    }
    (folder / "metrics.json").write_text(json.dumps(record), encoding="utf-8")
    return folder


def write_error_tables(folder: Path) -> None:
    """Add the tables of errors of a clip `straight` and of two stills."""
    boxes = ["model,part,file,frame,kind,label,found,score,iou,size_px,distance_m,fog_per_m,shadow,blur_px"]
    boxes += [
        f"shipped,stills,a{i}.jpg,{i},target,pad,{int(i > 2)},0.9,0.8,{10 + 5 * i},{20 - i},0,,0" for i in range(9)
    ]
    boxes += ["shipped,stills,b.jpg,9,false_alarm,pad,,0.7,,12,,,,"]
    poses = [
        "model,clip,frame,t_ns,method,stage,distance_m,tilt_deg,size_px,fog_per_m,visible,place_m,along_m,across_m"
    ]
    poses[0] += ",normal_deg,rotation_deg,flipped,nees_place,nees_rotation"
    for i in range(60):
        method = "" if i == 30 else "tag"
        errors = ",,,,,,," if i == 30 else f"{0.01 + 0.001 * i},0.01,0.01,{0.5 + 0.01 * i},1,{int(i == 40)},1,1"
        poses.append(f"shipped,straight,{i},{i * STEP_NS},{method},near,{6 - 0.08 * i:.3f},5,20,0,1,{errors}")
    ahead = ["model,clip,frame,t_ns,track_id,reference,horizon_s,error_m,held_m"]
    ahead += [
        f"shipped,straight,{i},{i * STEP_NS},1,world,{h},{0.1 * h},{2 * h}" for i in range(50) for h in (0.1, 0.5)
    ]
    for name, lines in (("boxes.csv", boxes), ("pose_errors.csv", poses), ("prediction_errors.csv", ahead)):
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
