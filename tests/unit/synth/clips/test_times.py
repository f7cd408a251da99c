"""Stamps of frames: exact at a steady rate, in order and uneven at a variable one."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from landtool.synth.clips.times import frame_times_ns, time_base

RATES = (Fraction(30), Fraction(30000, 1001), Fraction(25, 2), Fraction(2997, 100))


@pytest.mark.parametrize("fps", RATES)
def test_a_steady_rate_is_exact(fps: Fraction) -> None:
    times = frame_times_ns(fps, 4.0, None)
    assert times[0] == 0
    assert len(times) == math.ceil(4 * fps)
    assert all(t == round(n * 1_000_000_000 / fps) for n, t in enumerate(times))


@pytest.mark.parametrize("fps", RATES)
def test_a_variable_rate_jitters_and_drops(fps: Fraction) -> None:
    period = 1e9 / float(fps)
    gaps = 0
    for seed in range(20):
        times = frame_times_ns(fps, 4.0, np.random.default_rng(seed))
        steps = np.diff(times)
        assert times[0] == 0
        assert all(isinstance(t, int) for t in times)
        assert steps.min() > 0.25 * period
        assert steps.std() > 0.05 * period
        assert times[-1] == pytest.approx(4e9, abs=2 * period)
        gaps += int((steps > 1.6 * period).sum())
    assert gaps > 20


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("vfr", [False, True])
def test_a_video_holds_the_stamps(fps: Fraction, vfr: bool) -> None:
    base = time_base(fps, vfr)
    for t_ns in frame_times_ns(fps, 3.0, np.random.default_rng(1) if vfr else None):
        ticks = round(Fraction(t_ns, 10**9) / base)
        assert round(ticks * base * 10**9) == t_ns


def test_the_shortest_clip_has_a_frame() -> None:
    assert frame_times_ns(Fraction(1), 0.5, None) == [0]
    assert frame_times_ns(Fraction(1), 0.5, np.random.default_rng(0)) == [0]


def test_a_clip_ends_where_it_was_asked_to() -> None:
    # 2.2 as a float is a little more than 2.2
    assert frame_times_ns(Fraction(5), 2.2, None)[-1] == 2_000_000_000
    assert frame_times_ns(Fraction(10), 0.75, None)[-1] == 700_000_000
