"""A run's tables as one flight: for each frame what was known, for the charts, the timeline and the worst frames."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from landtool.geometry import Array, Pose
from landtool.io.tables import Cell, ReadTable
from landtool.report.follow import Follower
from landtool.report.html.folders import Folder
from landtool.types import FrameResult, PadPose, Prediction, Reference, Track, TrackState

NS = 1_000_000_000
_BRIDGE_S = 0.2  # as in Follower: between measurements so near the way is a straight line
_Row = dict[str, Cell]


@dataclass(frozen=True, eq=False)
class Flight:
    """One landing, a row a frame; NaN where a number is unknown, "" where a name is.

    index: frame numbers. t_ns: their times, None without a clock. at: seconds since the first one, or the frame's
    number where there is no clock. distance_m, lateral_m, speed_mps, sigma_m (of the pose's place), reproj_px,
    ambiguity, haze: (N,). residual_m: the main prediction that came true there, its distance from what was measured.
    drone_m, pad_m, ahead_m: (N, 2) places from above in the world: of the drone, the pad, and the prediction made then.
    """

    index: list[int]
    t_ns: list[int | None]
    at: Array
    stage: list[str]
    method: list[str]
    state: list[str]
    status: list[str]
    reason: list[str]
    dehazed: list[bool]
    has_picture: list[bool]
    distance_m: Array
    lateral_m: Array
    speed_mps: Array
    sigma_m: Array
    reproj_px: Array
    ambiguity: Array
    residual_m: Array
    drone_m: Array
    pad_m: Array
    ahead_m: Array
    reference: Reference | None
    horizon_s: float | None
    foresight: dict[float, tuple[Array, Array]]

    def __len__(self) -> int:
        return len(self.index)

    @property
    def has_clock(self) -> bool:
        """Whether frames carry times."""
        return any(t_ns is not None for t_ns in self.t_ns)


def read_flight(run: Folder) -> Flight | None:
    """Return the flight of a run's tables; None where frames.csv is not there or has no row."""
    frames = run.tables.get("frames.csv")
    if frames is None or not len(frames):
        return None
    rows = list(_results(run, frames))
    follower = Follower()
    moments = [follower.see(result) for result in rows]
    known = [result.t_ns for result in rows if result.t_ns is not None]
    reference = next((moment.reference for moment in moments if moment.reference), None)
    residuals: dict[int, float] = {}
    for i, moment in enumerate(moments):
        if moment.residuals:
            residuals[i] = max(residual.length_m for residual in moment.residuals)

    def column(values: Iterator[float | None]) -> Array:
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)

    at = (m.t_s for m in moments) if known else (float(r.index) for r in rows)
    return Flight(
        index=[r.index for r in rows],
        t_ns=[r.t_ns for r in rows],
        at=column(iter(at)),
        stage=[r.stage or "" for r in rows],
        method=["" if r.pose is None else r.pose.method for r in rows],
        state=["" if m.track is None else m.track.status for m in moments],
        status=[r.status for r in rows],
        reason=[r.reason for r in rows],
        dehazed=[r.dehazed for r in rows],
        has_picture=[r.stage is not None or r.status == "ok" for r in rows],
        distance_m=column(m.distance_m for m in moments),
        lateral_m=column(m.lateral_m if m.reference == reference else None for m in moments),
        speed_mps=column(None if m.track is None else float(np.hypot(*m.track.state[2:])) for m in moments),
        sigma_m=column(None if r.pose is None else _place_sigma_m(r.pose) for r in rows),
        reproj_px=column(None if r.pose is None else r.pose.reproj_px for r in rows),
        ambiguity=column(None if r.pose is None else r.pose.ambiguity for r in rows),
        residual_m=column(residuals.get(i) for i in range(len(rows))),
        drone_m=_from_above(rows, _drone),
        pad_m=_from_above(rows, lambda r: None if r.world_T_pad is None else r.world_T_pad.translation),
        ahead_m=np.array(
            [
                m.track.predicted_xy_m
                if m.track is not None and m.track.reference == "world" and m.track.status != "tentative"
                else (np.nan, np.nan)
                for m in moments
            ]
        ).reshape(-1, 2),
        reference=reference,
        horizon_s=follower.horizon_s,
        foresight=_foresight(run),
    )


def _place_sigma_m(pose: PadPose) -> float:
    return float(np.sqrt(np.trace(pose.covariance[:3, :3])))


def _drone(result: FrameResult) -> Array | None:
    if result.world_T_pad is None or result.body_T_pad is None:
        return None
    return (result.world_T_pad @ result.body_T_pad.inverse()).translation


def _from_above(rows: list[FrameResult], place: object) -> Array:
    found = [place(row) for row in rows]  # type: ignore[operator]
    return np.array([(np.nan, np.nan) if xyz is None else xyz[:2] for xyz in found]).reshape(-1, 2)


def _results(run: Folder, frames: ReadTable) -> Iterator[FrameResult]:
    """Yield the frames as they were, as far as the tables tell."""
    poses = {row["frame"]: row for row in _rows(run.tables.get("poses.csv"))}
    places: dict[Cell, dict[Cell, Pose]] = defaultdict(dict)
    for row in _rows(run.tables.get("platform.csv")):
        places[row["frame"]][row["reference"]] = _pose(row)
    tracks = defaultdict(list)
    for row in _rows(run.tables.get("tracks.csv")):
        tracks[row["frame"]].append(_track(row))
    t_ns = frames.ints("t_ns")
    for i, index in enumerate(frames.ints("frame")):
        pose = poses.get(index)
        yield FrameResult(
            index or 0,
            t_ns[i],
            status="damaged" if frames.columns["status"][i] == "damaged" else "ok",
            reason=str(frames.columns["reason"][i] or ""),
            dehazed=bool(frames.columns["dehazed"][i]),
            stage=frames.columns["stage"][i],  # type: ignore[arg-type]
            pose=None if pose is None else _pad_pose(pose),
            body_T_pad=places[index].get("body"),
            world_T_pad=places[index].get("world"),
            tracks=tuple(tracks[index]),
        )


def _rows(table: ReadTable | None) -> Iterator[_Row]:
    if table is not None:
        names = list(table.columns)
        for values in zip(*table.columns.values(), strict=True):
            yield dict(zip(names, values, strict=True))


def _numbers(row: _Row, names: str) -> list[float]:
    return [np.nan if (value := row[name]) is None else float(value) for name in names.split()]


def _pose(row: _Row) -> Pose:
    return Pose.from_quaternion(_numbers(row, "x_m y_m z_m"), _numbers(row, "qw qx qy qz"))


def _pad_pose(row: _Row) -> PadPose:
    place, turn = _numbers(row, "var_x_m2 var_y_m2 var_z_m2"), _numbers(row, "var_rot_rad2")
    ambiguity, reproj_px = _numbers(row, "ambiguity reproj_px")
    method = str(row["method"])
    return PadPose(_pose(row), np.diag([*place, *turn * 3]), method, ambiguity, reproj_px)  # type: ignore[arg-type]


def _track(row: _Row) -> Track:
    state: TrackState = row["state"]  # type: ignore[assignment]
    reference: Reference = row["reference"]  # type: ignore[assignment]
    ahead = np.array(_numbers(row, "x_pred_m y_pred_m"))
    (horizon_s,) = _numbers(row, "horizon_s")
    none: tuple[Prediction, ...] = ()
    values = np.array(_numbers(row, "x_m y_m vx_mps vy_mps"))
    spread = np.diag(_numbers(row, "var_x_m2 var_y_m2 var_vx var_vy"))
    nis = None if row["nis"] is None else float(row["nis"])
    return Track(int(row["track_id"] or 0), state, reference, values, spread, nis, horizon_s, ahead, none)


def _foresight(run: Folder) -> dict[float, tuple[Array, Array]]:
    """Return, by horizon in seconds, how far predictions were off what was measured then, and how far holding was.

    Of proven tracks only. Between two measurements at most 0.2 s apart the way is taken for a straight line.
    """
    names = ("predictions.csv", "platform.csv", "tracks.csv")
    if any(name not in run.tables for name in names):
        return {}
    ahead, places, tracks = (run.tables[name] for name in names)
    proven = {
        (frame, track_id)
        for frame, track_id, state in zip(
            tracks.ints("frame"), tracks.ints("track_id"), tracks.texts("state"), strict=True
        )
        if state != "tentative"
    }
    known = [pair in proven for pair in zip(ahead.ints("frame"), ahead.ints("track_id"), strict=True)]
    found: dict[float, list[tuple[Array, Array]]] = defaultdict(list)
    for reference in ("world", "body"):
        of_places = np.array([name == reference for name in places.texts("reference")], dtype=bool)
        of_ahead = np.array([name == reference for name in ahead.texts("reference")], dtype=bool) & np.array(
            known, bool
        )
        way = _Way(places, of_places)
        if not way.usable or not of_ahead.any():
            continue
        made_s, horizon_s = way.seconds(ahead)[of_ahead], ahead.floats("horizon_s")[of_ahead]
        xy_m = np.column_stack([ahead.floats("x_pred_m"), ahead.floats("y_pred_m")])[of_ahead]
        for horizon in np.unique(horizon_s):
            chosen = horizon_s == horizon
            then, start = way.at(made_s[chosen] + horizon), way.at(made_s[chosen])
            error_m = np.linalg.norm(xy_m[chosen] - then, axis=1)
            held_m = np.linalg.norm(start - then, axis=1)
            both = np.isfinite(error_m) & np.isfinite(held_m)
            found[float(horizon)].append((error_m[both], held_m[both]))
    joined = {h: tuple(np.concatenate(parts) for parts in zip(*of, strict=True)) for h, of in sorted(found.items())}
    return {h: (error_m, held_m) for h, (error_m, held_m) in joined.items() if len(error_m)}


class _Way:
    """Where the pad was measured over time, in one reference frame."""

    def __init__(self, places: ReadTable, chosen: Array) -> None:
        stamps = [t for t, of in zip(places.ints("t_ns"), chosen, strict=True) if of]
        self._start_ns = next((t for t in stamps if t is not None), 0)
        t_s = np.array([np.nan if t is None else (t - self._start_ns) / NS for t in stamps])
        xy_m = np.column_stack([places.floats("x_m"), places.floats("y_m")])[chosen]
        # the clock may step back: only where it goes on is there a way
        forward = np.isfinite(t_s)
        forward[forward] &= np.diff(np.maximum.accumulate(t_s[forward]), prepend=-np.inf) > 0.0
        self._t_s, self._xy_m = t_s[forward], xy_m[forward]
        self.usable = len(self._t_s) > 1

    def seconds(self, table: ReadTable) -> Array:
        """Return a table's times (N,) in seconds since the way's start."""
        return np.array([np.nan if t is None else (t - self._start_ns) / NS for t in table.ints("t_ns")])

    def at(self, t_s: Array) -> Array:
        """Return the place (N, 2) at times (N,), NaN outside and where measurements lie too far apart."""
        after = np.searchsorted(self._t_s, t_s - 1e-6).clip(1, len(self._t_s) - 1)
        gap_s = self._t_s[after] - self._t_s[after - 1]
        inside = (t_s >= self._t_s[0] - 1e-6) & (t_s <= self._t_s[-1] + 1e-6)
        on_one = np.minimum(np.abs(self._t_s[after] - t_s), np.abs(self._t_s[after - 1] - t_s)) < 1e-6
        good = inside & ((gap_s <= _BRIDGE_S) | on_one)
        xy = np.column_stack([np.interp(t_s, self._t_s, self._xy_m[:, k]) for k in (0, 1)])
        return np.where(good[:, None], xy, np.nan)
