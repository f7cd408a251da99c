"""When the pictures of a clip are taken."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from landtool.io.video_out import FINE, MAX_TIMESCALE

NS = 1_000_000_000
_JITTER, _MOST_JITTER = 0.06, 0.2  # of a period: standard deviation and bound
_DROPPED = 0.08
_DRIFT = 0.15  # of a period: how far the rate wanders, as when a camera exposes longer in the dark


def frame_times_ns(fps: Fraction, duration_s: float, rng: np.random.Generator | None) -> list[int]:
    """Return the stamps of all frames before `duration_s`, strictly increasing, the first 0.

    rng: for a variable rate: uneven steps and dropped frames, in whole microseconds so that a video can hold them. None
    for stamps at n / fps.
    """
    # the decimal that was asked for, not the float beside it
    count = max(1, math.ceil(Fraction(str(duration_s)) * fps))
    if rng is None:
        return [round(Fraction(n * NS) / fps) for n in range(count)]
    period_us = float(1_000_000 / fps)
    wander = _DRIFT * np.sin(np.arange(count) * rng.uniform(0.02, 0.08) + rng.uniform(0.0, 6.28))
    jitter = np.clip(rng.normal(0.0, _JITTER, count), -_MOST_JITTER, _MOST_JITTER)
    steps = 1.0 + wander - wander.mean()
    nominal = np.cumsum(steps) - steps[0]
    # a step is at least 1 - 0.3 - 2 * 0.2 periods long, so the order stays
    times_us = np.rint((nominal + jitter - jitter[0]) * period_us).astype(np.int64)
    kept = rng.random(count) >= _DROPPED
    kept[0] = kept[-1] = True
    return [int(t) * 1000 for t in times_us[kept]]


def time_base(fps: Fraction, vfr: bool) -> Fraction:
    """Return a clock in which a video holds the stamps of `frame_times_ns` exactly."""
    if vfr:
        return FINE
    # many ticks a picture, as FFmpeg has them: players divide less finely otherwise
    fine = max(1, 15_360 // fps.numerator)
    base = 1 / (fps * fps.denominator * fine)
    return base if base.denominator <= MAX_TIMESCALE else 1 / fps
