"""Predictions of the platform's place against truth, and whether their covariances are honest: landings in numbers."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from bench.landings import FPS, Landing, landings
from bench.show import table
from landtool.geometry import Array
from landtool.io.poses import STRAIGHT_DOWN
from landtool.synth.clips.scenarios import ScenarioName
from landtool.tracking.platform import PlatformTracker
from landtool.tracking.tracker import TrackerConfig

RUNS = 20  # the constants of landtool.tracking.motion were chosen on these same landings
DRIVES: tuple[ScenarioName, ...] = ("straight", "turn", "stop-and-go", "figure-eight")
HORIZONS_S = (0.1, 0.25, 0.5, 1.0)
FIRST_S = 1.0  # a track is judged from then on
SWITCH_M = 6.0  # of the paper: the box above, the tag below
TARGET_BELOW_M, TAG_BELOW_M = 15.0, 5.0  # of ours
# the acceleration is landtool's former default, no number of the paper's; its switch leaves nothing between box and tag
PAPER = TrackerConfig(motion="constant-velocity", measurement="paper", accel_sigma_mps2=2.0)
PLAIN = TrackerConfig(motion="constant-velocity", accel_sigma_mps2=2.0)
OURS = TrackerConfig()
WAYS = {
    "paper": (PAPER, SWITCH_M, SWITCH_M),
    "constant velocity": (PLAIN, TARGET_BELOW_M, TAG_BELOW_M),
    "landtool": (OURS, TARGET_BELOW_M, TAG_BELOW_M),
}


@dataclass
class Errors:
    """What one way did. off: by horizon, the errors (., 2); its NEES by horizon; NEES and NIS of the track itself."""

    off: dict[float, list[Array]] = field(default_factory=lambda: {h: [] for h in HORIZONS_S})
    ahead: dict[float, list[float]] = field(default_factory=lambda: {h: [] for h in HORIZONS_S})
    nees: list[float] = field(default_factory=list)
    nis: list[float] = field(default_factory=list)
    smoothed: list[tuple[float, ...]] = field(default_factory=list)
    tracks: int = 0
    seconds: float = 0.0
    frames: int = 0

    def rmse_m(self, horizon_s: float) -> float:
        """Return the root of the mean squared distance to the truth."""
        return float(np.sqrt(np.mean(np.sum(np.square(self.off[horizon_s]), axis=1))))


def main() -> None:
    """Print how far predictions are off, and how honest they are."""
    found = {(drive, ego): _compared(drive, ego=ego) for ego in (True, False) for drive in DRIVES}
    for ego in (True, False):
        rows = [
            [drive, way, *(f"{errors.rmse_m(h):.3f}" for h in HORIZONS_S), *_less(found[drive, ego], errors)]
            for drive in DRIVES
            for way, errors in found[drive, ego].items()
        ]
        head = ["drive", "way", *(f"{h:g} s" for h in HORIZONS_S), "vs hold", "vs paper"]
        told = "with the drone's poses" if ego else "without the drone's poses, in its own frame"
        table(f"RMSE of the predicted place, m, {told}; least gain over the horizons; {RUNS} landings", head, rows)
    _honest(found)


def _less(ways: dict[str, Errors], errors: Errors) -> list[str]:
    """Return by how many percent a way is better than holding the last place and than the paper, at its worst."""
    cells = []
    for name in ("hold last", "paper"):
        gains = [1.0 - errors.rmse_m(h) / ways[name].rmse_m(h) for h in HORIZONS_S]
        cells.append("" if errors is ways[name] else f"{100.0 * min(gains):.0f} %")
    return cells


def _honest(found: dict[tuple[ScenarioName, bool], dict[str, Errors]]) -> None:
    rows = []
    for (drive, ego), ways in found.items():
        errors = ways["landtool"]
        ahead = [f"{np.mean(errors.ahead[h]):.2f}" for h in HORIZONS_S]
        *squares, nees = np.mean(errors.smoothed, axis=0)
        rmse = [*(f"{np.sqrt(square):.3f}" for square in squares), f"{nees:.2f}"]
        cells = [f"{np.mean(errors.nis):.2f}", f"{np.mean(errors.nees):.2f}", *ahead, *rmse]
        ms = 1e3 * errors.seconds / errors.frames
        rows.append([drive, "yes" if ego else "no", *cells, errors.tracks, f"{ms:.2f}"])
    ahead_head = [f"{h:g} s" for h in HORIZONS_S]
    head = [
        "drive",
        "ego",
        "NIS (2)",
        "NEES (4)",
        *ahead_head,
        "m",
        "smoothed",
        "m/s",
        "smoothed",
        "NEES",
        "tracks",
        "ms",
    ]
    table(
        "Honesty of landtool's covariances (expected value), NEES of predictions (2); RMSE, and the smoother's",
        head,
        rows,
    )


def _compared(drive: ScenarioName, *, ego: bool) -> dict[str, Errors]:
    """Return what each way does in a scenario."""
    runs = landings(drive, RUNS)
    found = {"hold last": Errors()}
    for landing in runs:
        _hold(landing, found["hold last"], world=ego)
    for way, (config, target_below_m, tag_below_m) in WAYS.items():
        found[way] = Errors()
        for landing in runs:
            follow(landing, config, found[way], ego=ego, target_below_m=target_below_m, tag_below_m=tag_below_m)
    return found


def _hold(landing: Landing, errors: Errors, *, world: bool) -> None:
    tracker = PlatformTracker(OURS, STRAIGHT_DOWN, landing.ego if world else None)
    places = []
    poses = landing.measured(target_below_m=TARGET_BELOW_M, tag_below_m=TAG_BELOW_M)
    for t_ns, pose in zip(landing.t_ns.tolist(), poses, strict=True):
        body_T_pad, world_T_pad = tracker.placed(t_ns, pose)
        place = world_T_pad if world else body_T_pad
        assert place is not None
        places.append(place.translation[:2])
    truth = landing.places_m(world=world)
    for h in HORIZONS_S:
        for k in range(round(FIRST_S * FPS), len(places)):
            later = _at(truth, k + h * FPS)
            if later is not None:
                errors.off[h].append(later - places[k])


def _at(truth: Array, frame: float) -> Array | None:
    """Return the true place at a frame or between two, None after the last."""
    if frame > len(truth) - 1:
        return None
    before, part = int(frame), frame - int(frame)
    return np.asarray(truth[before] if part == 0.0 else (1.0 - part) * truth[before] + part * truth[before + 1])


def follow(
    landing: Landing, config: TrackerConfig, errors: Errors, *, ego: bool, target_below_m: float, tag_below_m: float
) -> None:
    """Track one landing and add what was wrong."""
    truth = landing.places_m(world=ego)
    speeds = np.gradient(truth, 1.0 / FPS, axis=0)
    tracker = PlatformTracker(config, STRAIGHT_DOWN, landing.ego if ego else None, record=True)
    poses = list(landing.measured(target_below_m=target_below_m, tag_below_m=tag_below_m))
    seen = set()
    states = {}
    for k, (t_ns, pose) in enumerate(zip(landing.t_ns.tolist(), poses, strict=True)):
        start = time.perf_counter()
        stepped = tracker.step(t_ns, (pose,))
        errors.seconds += time.perf_counter() - start
        errors.frames += 1
        seen |= {track.track_id for track in stepped.tracks if track.status == "confirmed"}
        if k < FIRST_S * FPS or not stepped.tracks:
            continue
        track = stepped.tracks[0]
        off = np.concatenate([truth[k], speeds[k]]) - track.state
        states[k, track.track_id] = off
        errors.nees.append(float(off @ np.linalg.solve(track.covariance, off)))
        if track.nis is not None:
            errors.nis.append(track.nis)
        for prediction in track.predictions:
            place = _at(truth, k + prediction.horizon_s * FPS)
            if place is not None:
                off = place - prediction.xy_m
                errors.off[prediction.horizon_s].append(off)
                errors.ahead[prediction.horizon_s].append(float(off @ np.linalg.solve(prediction.covariance, off)))
    errors.tracks += len(seen)
    if config is OURS:
        smoothed = tracker.smoothed()
        for (k, track_id), before in states.items():
            state = smoothed[k, track_id]
            off = np.concatenate([truth[k], speeds[k]]) - state.mean
            nees = float(off @ np.linalg.solve(state.covariance, off))
            squares = [float(part @ part) for part in (before[:2], off[:2], before[2:], off[2:])]
            errors.smoothed.append((*squares, nees))
