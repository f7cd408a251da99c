"""The settings of a track: how the platform is expected to move, and when a track is believed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from landtool.errors import UsageError

MeasurementModel = Literal["position", "paper"]
MotionName = Literal["adaptive", "constant-velocity"]

# The least and the most each number of a TrackerConfig may be
BOUNDS: dict[str, tuple[float, float]] = {
    "accel_sigma_mps2": (1e-3, 1e3),
    "init_velocity_sigma_mps": (1e-3, 1e3),
    "gate_probability": (0.5, 0.999999),
    "same_place_m": (0.0, 100.0),
    "confirm_hits": (1, 1000),
    "confirm_window": (1, 1000),
    "replace_hits": (1, 1000),
    "coast_s": (0.0, 3600.0),
    "backward_s": (0.0, 3600.0),
    "horizon_s": (0.0, 60.0),
    "camera_delay_s": (0.0, 10.0),
    "ego_position_sigma_m": (0.0, 100.0),
    "ego_attitude_sigma_deg": (0.0, 90.0),
    "ego_attitude_bias_deg": (0.0, 90.0),
    "ego_drift_m": (0.0, 100.0),
}


@dataclass(frozen=True)
class TrackerConfig:
    """How the platform is expected to move, and when a track is believed. Raises UsageError outside `BOUNDS`."""

    # adaptive: the platform drives steadily or manoeuvres, whichever its measurements say; in the body frame the
    # drone keeps itself above it and swings. constant-velocity: the paper's; measurement = "paper" always has it
    motion: MotionName = "adaptive"
    # sigma of the platform's acceleration in the world: adaptive: in a manoeuvre; constant-velocity: new at every step,
    # in the body frame too
    accel_sigma_mps2: float = 1.0
    # sigma of the velocity of a track seen once: the faster, the more its second measurement may differ
    init_velocity_sigma_mps: float = 5.0
    # share of the right measurements that pass the gate on the normalised innovation squared
    gate_probability: float = 0.999
    # a measurement so near to where a confirmed track should be is of it even beyond the gate, as pads do not overlap:
    # the platform brakes or turns harder than was expected
    same_place_m: float = 0.5
    # a tentative track is confirmed by so many measurements ...
    confirm_hits: int = 3
    # ... in so many frames, and dropped when it cannot get them any more
    confirm_window: int = 5
    # a confirmed track that is not measured any more gives way to a confirmed newer one of so many measurements
    replace_hits: int = 5
    # a track ends when its last measurement is longer ago than this
    coast_s: float = 2.0
    # a frame this late is put in at its right place; when the clock steps back by more, all tracks end
    backward_s: float = 0.1
    # how far ahead the place of the platform is predicted
    horizon_s: float = 0.5
    # further predictions
    horizons_s: tuple[float, ...] = (0.1, 0.25, 0.5, 1.0)
    # how much later a frame's stamp is than its exposure
    camera_delay_s: float = 0.0
    # how far the drone's own poses are off from pose to pose, where they are known: each direction
    ego_position_sigma_m: float = 0.01
    # the same of their attitude, each axis, which counts more the farther away the pad is
    ego_attitude_sigma_deg: float = 0.1
    # how far their attitude is off all the time, each axis
    ego_attitude_bias_deg: float = 0.3
    # how far their place drifts in a second; it grows with the root of the time
    ego_drift_m: float = 0.02
    # what counts as measured: the position, or the paper's position and velocity made of two positions
    measurement: MeasurementModel = "position"

    def __post_init__(self) -> None:
        for name, (low, high) in BOUNDS.items():
            if not low <= getattr(self, name) <= high:
                raise UsageError(f"{name} = {getattr(self, name)} is outside {low:g} to {high:g}")
        low, high = BOUNDS["horizon_s"]
        for horizon_s in self.horizons_s:
            if not (math.isfinite(horizon_s) and low <= horizon_s <= high):
                raise UsageError(f"horizons_s: {horizon_s} is outside {low:g} to {high:g}")
        if self.confirm_hits > self.confirm_window:
            reason = f"confirm_hits = {self.confirm_hits} can never be reached in {self.confirm_window} frames"
            raise UsageError(reason, hint="raise confirm_window")
        for name, kind in (("measurement", MeasurementModel), ("motion", MotionName)):
            if getattr(self, name) not in get_args(kind):
                known = ", ".join(get_args(kind))
                raise UsageError(f"unknown {name} '{getattr(self, name)}'", hint=f"known: {known}")
