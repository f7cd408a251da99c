"""The tone curve and the blur of a clip's pictures, from the pad's own printed edges.

Light decoded by a wrong curve has every blurred edge displaced towards its dark side by the same s. The gamma whose s
is zero is the one with which edges are found where they are, whatever blurred them: what poses need, even where the
true curve is no power law.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Pose
from landtool.pad import PadSpec
from landtool.target.edge_shift import EdgeProfiles, Shift, edge_profiles
from landtool.target.edges import printed_edges
from landtool.tone import Tone
from landtool.types import Image

# Smaller pads have too few pixels a stroke; on larger ones the errors of print and paper are no longer small
_LEAST_PX, _MOST_PX = 90.0, 330.0
_EVERY = 3  # frames that show the pad: neighbours show the same
_MOST_FRAMES, _LEAST_FRAMES = 30, 6
_MOST_TRIED = 120  # a clip whose white is burnt out must not go on costing time
_SRGB_GAMMA = 2.2  # about, to begin with
_LOG_RANGE = (math.log(0.5), math.log(5.0))  # "none" is a gamma of 1, and cameras lie between 1 and 3
_LOG_STEP, _ROUNDS, _LOG_REST = 0.1, 8, 0.003
_LEAST_SLOPE_PX = 0.02  # edges so sharp that no curve moves them tell nothing
# What no number of frames averages out: compression and sharpening, seen on generated clips; ink that spreads
_SYSTEMATIC_PX, _INK_M = 0.02, 1e-4
_SETTLED_SIGMA = 0.25  # of gamma, which displaces the pad by 0.05 % of its distance
_SAME, _OTHER = 2.0, 3.0  # standard deviations


@dataclass(frozen=True)
class ToneEstimate:
    """What the pad's edges tell of a clip's pictures.

    gamma: exponent that puts the edges where they are; sigma_gamma: its standard error, with the scatter between
    frames and what all frames have in common. blur_px: standard deviation of the light's spread across an edge, the
    pixel's own area not counted. frames: how many it is from. tone: the curve to use: the one assumed where the edges
    agree with it, `none` near 1, else gamma. is_settled: it is better to use `tone` than to go on as before.
    """

    gamma: float
    sigma_gamma: float
    blur_px: float
    frames: int
    tone: Tone
    is_settled: bool


@dataclass(frozen=True)
class _Reading:
    """One frame's. at_gamma: with its shift zero. slope_px: ds/dgamma there. assumed_px: shift by the curve assumed.

    systematic_px: standard deviation of what else may shift the edges.
    """

    gamma: float
    at_gamma: Shift
    slope_px: float
    assumed_px: float
    systematic_px: float


class ToneGauge:
    """Gauges the tone curve over the frames of a clip.

    assumed: the curve the poses are measured with. Takes every third frame that shows the pad 90 to 330 pixels wide,
    30 at the most, and passes over those whose white is burnt out.
    """

    def __init__(self, pad: PadSpec, camera: Camera, assumed: Tone) -> None:
        self._camera, self._assumed = camera, assumed
        self._printed = printed_edges(pad)
        # without a ring there is nothing that faces both ways far enough apart
        self._width_m = pad.ring.outer * pad.diameter_m if pad.ring else 0.0
        self._offered = 0
        self._readings: list[_Reading] = []

    def add(self, image: Image, camera_T_pad: Pose) -> None:
        """Take one frame's edges into account; what cannot be used is passed over.

        image: (H, W, 3) BGR uint8 of the camera's size. camera_T_pad: within a pixel or so.
        """
        px_per_m = min(self._camera.fx, self._camera.fy) / float(camera_T_pad.translation[2])
        if len(self._readings) >= _MOST_FRAMES or not _LEAST_PX <= self._width_m * px_per_m <= _MOST_PX:
            return
        self._offered += 1
        if self._offered % _EVERY != 1 or self._offered > _EVERY * _MOST_TRIED:
            return
        profiles = edge_profiles(image, self._camera, camera_T_pad, self._printed, self._assumed)
        reading = _read(profiles, self._assumed, px_per_m) if profiles is not None else None
        if reading is not None:
            self._readings.append(reading)

    def estimate(self) -> ToneEstimate | None:
        """Return what is known so far; None before two frames have told something."""
        return _combined(self._readings, self._assumed) if len(self._readings) > 1 else None


def _read(profiles: EdgeProfiles, assumed: Tone, px_per_m: float) -> _Reading | None:
    """Find the gamma whose shift is zero, by secants; None where there is none."""
    before = profiles.shift(assumed)
    last_log = math.log(_SRGB_GAMMA if isinstance(assumed, str) else assumed)
    last = profiles.shift(math.exp(last_log))
    if before is None or last is None:
        return None
    # a higher gamma darkens the middle of the fall and moves the edge out of the dark, nearly straight over log gamma
    log = last_log + math.copysign(_LOG_STEP, last.shift_px)
    for _ in range(_ROUNDS):
        now = profiles.shift(math.exp(log)) if _LOG_RANGE[0] <= log <= _LOG_RANGE[1] else None
        if now is None:
            return None
        slope_px = (now.shift_px - last.shift_px) / (log - last_log)
        if not slope_px < -_LEAST_SLOPE_PX:
            return None
        step = -now.shift_px / slope_px
        if abs(step) < _LOG_REST:
            systematic_px = math.hypot(_SYSTEMATIC_PX, _INK_M * px_per_m)
            return _Reading(math.exp(log), now, slope_px / math.exp(log), before.shift_px, systematic_px)
        last_log, last, log = log, now, log + step
    return None


def _combined(readings: Sequence[_Reading], assumed: Tone) -> ToneEstimate:
    # medians: a frame with something across the pad is no rare thing
    gammas = np.array([r.gamma for r in readings])
    gamma = float(np.median(gammas))
    slope_px = abs(float(np.median([r.slope_px for r in readings])))
    scatter = 1.4826 * float(np.median(np.abs(gammas - gamma)))
    own = float(np.median([r.at_gamma.sigma_px for r in readings])) / slope_px
    # the error of a median is sqrt(pi / 2) times a mean's
    of_median = math.sqrt(math.pi / 2.0 / len(readings)) * max(scatter, own)
    sigma = math.hypot(of_median, float(np.median([r.systematic_px for r in readings])) / slope_px)
    off = abs(float(np.median([r.assumed_px for r in readings]))) / (sigma * slope_px)
    tone: Tone = round(gamma, 2)
    if off <= _SAME:
        tone = assumed
    elif abs(gamma - 1.0) <= _SAME * sigma:
        tone = "none"
    is_settled = len(readings) >= _LEAST_FRAMES and (sigma <= _SETTLED_SIGMA or off > _OTHER)
    blur_px = float(np.median([r.at_gamma.blur_px for r in readings]))
    return ToneEstimate(gamma, sigma, blur_px, len(readings), tone, is_settled)
