"""The whole method against truth: poses by distance, against the tag alone, honest covariances, predictions.

`python -m bench method` makes 8 clips, `python -m bench.method full` 20; none of them was used to choose a constant.
They lie in the system's temporary folder and are made once.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import get_args

import numpy as np
from scipy.stats import chi2

from bench.method_runs import Landing, Recipe, followed, landings, rendered
from bench.show import table
from landtool.evaluate.pose_difference import pose_difference
from landtool.evaluate.pose_errors import PoseError, pose_errors
from landtool.evaluate.prediction_errors import prediction_errors
from landtool.evaluate.track_errors import TrackError, track_errors
from landtool.geometry import Array
from landtool.synth.clips.scenarios import ScenarioName
from landtool.types import PoseMethod

SCENARIOS: tuple[ScenarioName, ...] = ("straight", "turn", "stop-and-go", "figure-eight", "heave", "occlusion")
FIRST_SEED = 3000  # constants were chosen on clips of seeds 600 to 618 and 2000 to 2006
SLOW = Recipe("straight", 2133)  # its platform drives 1 m/s
QUICK = (
    *(Recipe(name, FIRST_SEED + i) for i, name in enumerate(SCENARIOS)),
    Recipe("straight", FIRST_SEED + 6, 0.05),
    SLOW,
)
FULL = (
    *QUICK,
    *(Recipe(name, FIRST_SEED + 10 + i) for i, name in enumerate(SCENARIOS)),
    *(Recipe(name, FIRST_SEED + 20 + i, 0.04) for i, name in enumerate(SCENARIOS)),
)
BINS_M = (0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 25.0)
RANGES_M = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
HORIZONS_S = (0.1, 0.25, 0.5, 1.0)
STEPS = 40  # moments of a clip that are compared with the same moments of the others


def main(names: Sequence[str] = ()) -> None:
    """Print all tables."""
    found = landings(FULL if "full" in names else QUICK)
    for way, said in (("ego", "with the drone's poses"), ("alone", "without them")):
        _poses([run for run in found if run.way == way], f"{len(found) // 4} clips, {said}")
    _against_tags([run for run in found if run.way == "alone"])
    _honesty(found)
    _predictions(found)
    _rendered()


def _rendered() -> None:
    """Print the same of the clips of another renderer, where they are."""
    with tempfile.TemporaryDirectory() as folder:
        clips = rendered(Path(folder))
        if not clips:
            print("\npath-traced clips: not there, left out")
            return
        found = [followed(clip, way) for clip in clips for way in ("alone", "paper alone")]
    ours = [run for run in found if run.way == "alone"]
    _poses(ours, f"path-traced: {', '.join(run.clip for run in ours)}")
    _against_tags(ours)
    _predictions(found)


def _errors(runs: Sequence[Landing]) -> list[PoseError]:
    return [error for run in runs for error in pose_errors(run.clip, run.results, run.truth, run.camera, run.pad)]


def _poses(runs: Sequence[Landing], said: str) -> None:
    everything = _errors(runs)
    rows = []
    for low, high in [*pairwise(BINS_M), (0.0, 10.0), (0.0, 25.0)]:
        inside = [error for error in everything if low <= error.distance_m < high]
        whole = [_shares(error) for error in inside if error.whole]
        if not whole:
            continue
        middle, worse = np.median(whole, axis=0), np.percentile(whole, 95, axis=0)
        wanted = [error.whole for error in inside if error.measurable]
        share = f"{100.0 * sum(wanted) / len(wanted):.1f}" if wanted else ""
        methods = [error.method for error in inside if error.method is not None]
        shares = "/".join(f"{100.0 * methods.count(name) / len(methods):.0f}" for name in get_args(PoseMethod))
        place = [f"{middle[0]:.3f}", f"{worse[0]:.3f}", f"{middle[1]:.3f}", f"{middle[2]:.4f}"]
        turn = [f"{middle[3]:.2f}", f"{worse[3]:.2f}", f"{middle[4]:.2f}"]
        rows.append([f"{low:g}-{high:g}", len(whole), share, *place, *turn, shares])
    head = ["m", "n", "6-DoF %", "place %", "p95", "along %", "lateral %", "normal deg", "p95", "turn deg"]
    table(f"Poses by distance, medians; {said}", [*head, "tag/target/box %"], rows)
    proven = [error for error in everything if error.confirmed]
    mirrored, half_turns, told = (
        sum(bool(getattr(error, name)) for error in proven) for name in ("mirrored", "half_turn", "half_turn_told")
    )
    print(f"  flips after confirmation: {mirrored} mirrored, {half_turns} by half a turn, {told} more that were told")


def _shares(error: PoseError) -> Array:
    """Return the errors of place, along and across the line of sight in % of the distance; of normal and turn, deg."""
    place = [100.0 * (getattr(error, name) or 0.0) / error.distance_m for name in ("place_m", "along_m", "across_m")]
    return np.array([*place, error.normal_deg, error.rotation_deg], np.float64)


def _against_tags(runs: Sequence[Landing]) -> None:
    """Print errors of three ways on the same frames, those in which all three have a pose."""
    rows = []
    for low, high in pairwise(RANGES_M):
        ways: list[list[tuple[float, float]]] = [[], [], []]
        for run in runs:
            for result in run.results:
                pose, true = result.pose, run.truth.frames[result.index].camera_T_pad
                by_library, by_tag = run.library.get(result.index), run.tag.get(result.index)
                if pose is None or pose.method == "box" or true is None or by_library is None or by_tag is None:
                    continue
                distance_m = float(np.linalg.norm(true.translation))
                for errors, found in zip(ways, (by_library, by_tag, pose.camera_T_pad), strict=True):
                    off = pose_difference(found, true)
                    if low <= distance_m < high:
                        errors.append((100.0 * off.place_m / distance_m, off.rotation_deg))
        if not ways[0]:
            continue
        middle = [np.median(errors, axis=0) for errors in ways]
        places = [f"{m[0]:.3f}" for m in middle]
        turns = [f"{m[1]:.2f}" for m in middle]
        gains = [f"{middle[k][1] / middle[2][1]:.1f}" for k in (0, 1)]
        rows.append([f"{low:g}-{high:g}", len(ways[0]), *places, *turns, *gains])
    head = ["m", "n", "AprilTag place %", "tag", "target", "AprilTag deg", "tag", "target", "times better", "than tag"]
    table("The same frames by AprilTag and IPPE, by landtool's corners alone, by the target; medians", head, rows)


def _honesty(found: Sequence[Landing]) -> None:
    """Print normalised errors squared and their bands.

    Frames of one clip are not independent, those of different clips are. The mean over N clips at one moment lies in
    chi2(N dof) / N in 95 % of the moments; a mean over all frames is banded as if each clip were one frame.
    """
    rows = []
    for way in ("ego", "alone"):
        runs = [run for run in found if run.way == way]
        places = [_by_frame(run, _errors([run]), "nees_place") for run in runs]
        turns = [_by_frame(run, _errors([run]), "nees_rotation") for run in runs]
        tracks = [track_errors(run.clip, run.results, run.truth) for run in runs]
        judged = [[error for error in errors if error.judged] for errors in tracks]
        kinds = [
            ("place", 3, places),
            ("turn", 3, turns),
            ("track", 4, [_by_frame(run, errors, "nees") for run, errors in zip(runs, judged, strict=True)]),
            ("NIS", 2, [_by_frame(run, errors, "nis") for run, errors in zip(runs, judged, strict=True)]),
        ]
        rows += [[way, name, dof, *_honest(values, dof)] for name, dof, values in kinds]
    head = ["way", "", "dof", "mean", "band", "median", "chi2's", "moments in band %"]
    table("NEES and NIS, 95 % bands over the clips", head, rows)


def _by_frame(run: Landing, errors: Sequence[PoseError] | Sequence[TrackError], name: str) -> list[float | None]:
    """Return a value of every frame, None where it has none; of poses of six degrees of freedom only."""
    told = {e.frame: getattr(e, name) for e in errors if isinstance(e, TrackError) or e.whole}
    return [told.get(result.index) for result in run.results]


def _honest(values: Sequence[Sequence[float | None]], dof: int) -> list[str]:
    known = [np.array([v for v in row if v is not None]) for row in values]
    known = [row for row in known if row.size]
    low, high = chi2.ppf((0.025, 0.975), len(known) * dof) / len(known)
    inside = []
    for step in range(STEPS):
        at = [row[min(len(row) - 1, round(step * len(row) / STEPS))] for row in values]
        now = [v for v in at if v is not None]
        if len(now) > 2:
            least, most = chi2.ppf((0.025, 0.975), len(now) * dof) / len(now)
            inside.append(least <= float(np.mean(now)) <= most)
    mean = float(np.mean([row.mean() for row in known]))
    median = float(np.median(np.concatenate(known)))
    return [
        f"{mean:.2f}", f"{low:.2f}-{high:.2f}", f"{median:.2f}", f"{chi2.ppf(0.5, dof):.2f}",
        f"{100.0 * np.mean(inside):.0f}",
    ]  # fmt: skip


def _predictions(found: Sequence[Landing]) -> None:
    """Print the RMSE of predicted places by clip, and the same of two simpler ways."""
    for ours, paper in (("ego", "paper ego"), ("alone", "paper alone")):
        rows: list[list[object]] = []
        for clip in dict.fromkeys(run.clip for run in found if run.way == ours):
            run, other = (next(r for r in found if r.clip == clip and r.way == way) for way in (ours, paper))
            rows += _clip_rows(clip, run, other)
        if rows:
            head = ["clip", "way", *(f"{h:g} s" for h in HORIZONS_S), "frames"]
            table(f"RMSE of predicted places, m; {ours}", head, rows)


def _clip_rows(clip: str, run: Landing, paper: Landing) -> Iterator[list[object]]:
    ours, theirs = (prediction_errors(clip, landing.results, landing.truth) for landing in (run, paper))
    for name, errors, what in (("landtool", ours, "error_m"), ("held", ours, "held_m"), ("paper", theirs, "error_m")):
        off = [np.array([getattr(e, what) for e in errors if e.horizon_s == h]) for h in HORIZONS_S]
        rmse = [f"{math.sqrt(float(np.mean(values**2))):.3f}" if values.size else "" for values in off]
        yield [clip, name, *rmse, len(off[0])]


if __name__ == "__main__":
    main(sys.argv[1:])
