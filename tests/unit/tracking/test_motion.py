"""Motions against truth drawn from them: no lag, and covariances that are honest over many runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import Generator
from scipy.stats import chi2

from landtool.geometry import Array
from landtool.tracking.config import TrackerConfig
from landtool.tracking.measurement import PlanarMeasurement
from landtool.tracking.motion import BodyMotion, ConstantVelocity, Motion, WorldMotion, motion_of
from landtool.tracking.smooth import RecordedStep, smooth
from landtool.tracking.tracker import Tracker
from landtool.types import Reference

RUNS, FRAMES = 20, 60
FRAME_NS = 33_333_333
R: Array = np.diag([0.02**2, 0.03**2])


def drawn(motion: Motion, reference: Reference, rng: Generator) -> tuple[list[PlanarMeasurement], Array]:
    """One run of the model itself, steady ways only: measurements, and true place and velocity (FRAMES, 4)."""
    heights = np.linspace(20.0, 2.0, FRAMES)
    step = motion.step(FRAME_NS * 1e-9)

    def sight(k: int) -> PlanarMeasurement:
        lever = (
            np.array([[0.0, heights[k], 0.3], [-heights[k], 0.0, -0.2]]) if reference == "world" else np.zeros((2, 3))
        )
        return PlanarMeasurement(np.zeros(2), R, -heights[k], 1e-4, lever)

    start = motion.begin(sight(0), 0.0)
    x = np.linalg.cholesky(start.covariances[0] + 1e-12 * np.eye(start.means.shape[1])) @ rng.normal(
        size=start.means.shape[1]
    )
    # the first measurement is its start's mean
    seen, truth = [sight(0)], []
    rate = (heights[1] - heights[0]) / (FRAME_NS * 1e-9)
    for k in range(FRAMES):
        if k:
            root = np.linalg.cholesky(step.Q[0] + 1e-15 * np.eye(len(x)))
            x = step.F[0] @ x + root @ rng.normal(size=len(x))
            like = sight(k)
            z = motion.sight(like) @ x + np.sqrt(np.diag(R)) * rng.normal(size=2)
            seen.append(PlanarMeasurement(z, R, like.z_m, like.z_variance_m2, like.lever_m))
        h, q = heights[k], x[4:6] if reference == "body" else np.zeros(2)
        turned = x[6:8] if reference == "body" else np.zeros(2)
        truth.append(np.concatenate([x[:2] + h * q, x[2:4] + h * turned + rate * q]))
    return seen, np.array(truth)


@pytest.mark.parametrize(("reference", "exact"), [("world", False), ("world", True), ("body", True)])
def test_nees_and_nis_lie_in_their_bands_and_the_smoother_knows_more(reference: Reference, exact: bool) -> None:
    config = TrackerConfig(gate_probability=0.999999, init_velocity_sigma_mps=2.0, horizons_s=())
    if exact:  # the drone's own poses: what they are off by no smoother can tell from where the platform is
        config = replace(config, ego_attitude_bias_deg=0.0, ego_drift_m=0.0)
    rng = np.random.default_rng(7)
    nees, nis, filtered, smoothed, smooth_nees = [], [], [], [], []
    for _ in range(RUNS):
        motion = motion_of(config, reference)
        seen, truth = drawn(motion, reference, rng)
        followed, steps, rows = Tracker(config, reference), [], []
        for k, measurement in enumerate(seen):
            (track,) = followed.step(k * FRAME_NS, [measurement])
            rows.append(track)
            steps.append(RecordedStep(k * FRAME_NS, (measurement,), followed.taken, (track.track_id,)))
        states = smooth(steps, followed.motion)
        assert len(states) == FRAMES
        for k in range(30, FRAMES):
            off, late = truth[k] - rows[k].state, truth[k] - states[k, 1].mean
            nees.append(off @ np.linalg.solve(rows[k].covariance, off))
            smooth_nees.append(late @ np.linalg.solve(states[k, 1].covariance, late))
            filtered.append(off**2)
            smoothed.append(late**2)
            nis.append(rows[k].nis or 0.0)
        last = FRAMES - 1
        tolerance = {"world": 0.02, "body": 1e-8}[reference]  # in the world two ways of moving become one
        np.testing.assert_allclose(states[last, 1].mean, rows[last].state, atol=tolerance)
    # one way of moving is what truth is drawn from: the other can only widen what is expected of it
    low, high = chi2.ppf([0.025, 0.975], 2 * len(nis)) / len(nis)
    slack = {"world": 0.8, "body": 1.0}[reference]
    assert slack * low < np.mean(nis) < high
    # frames of a run share their errors: the band of so many runs
    low, high = chi2.ppf([0.025, 0.975], 4 * RUNS) / RUNS
    assert slack * low < np.mean(nees) < high
    assert slack * low < np.mean(smooth_nees) < high
    gain = np.mean(smoothed, axis=0) / np.mean(filtered, axis=0)
    assert gain[2:].max() < 0.8  # velocity, squared
    if exact:
        assert gain[:2].max() < 0.8  # place, squared


@pytest.mark.parametrize("reference", ["world", "body"])
def test_a_straight_line_is_followed_without_lag(reference: Reference) -> None:
    speed = {"world": 5.0, "body": 0.3}[reference]  # in the body's frame a platform is not left behind for long
    followed = Tracker(TrackerConfig(), reference)
    rng = np.random.default_rng(5)
    late = []
    for k in range(240):
        x = speed * k * FRAME_NS * 1e-9
        (track,) = followed.step(k * FRAME_NS, [PlanarMeasurement(np.array([x, 0.0]) + 0.02 * rng.normal(size=2), R)])
        if k > 60:
            late.append(x - track.state[0])
    assert abs(np.mean(late)) < 0.005


def test_a_swing_of_the_drone_is_no_motion_of_the_platform() -> None:
    # the pad 15 m below stands, the drone swings by 2 degrees
    config = {"adaptive": TrackerConfig(), "plain": TrackerConfig(motion="constant-velocity")}
    rmse = {}
    for name, settings in config.items():
        followed = Tracker(settings, "body")
        off = []
        rng = np.random.default_rng(6)
        places = 15.0 * np.radians(2.0) * np.sin(2.0 * np.arange(300) * FRAME_NS * 1e-9)
        for k in range(285):
            z = np.array([places[k], 0.0]) + 0.02 * rng.normal(size=2)
            tracks = followed.step(k * FRAME_NS, [PlanarMeasurement(z, R, -15.0, 0.01)])
            if k > 60:
                off.append(tracks[0].predicted_xy_m - [places[k + 15], 0.0])
        rmse[name] = np.sqrt(np.mean(np.square(off)))
    assert rmse["adaptive"] < 0.8 * rmse["plain"]


def test_the_settings_choose_the_motion() -> None:
    assert isinstance(motion_of(TrackerConfig(), "world"), WorldMotion)
    assert isinstance(motion_of(TrackerConfig(), "body"), BodyMotion)
    assert isinstance(motion_of(TrackerConfig(motion="constant-velocity"), "world"), ConstantVelocity)
    assert isinstance(motion_of(TrackerConfig(measurement="paper"), "world"), ConstantVelocity)


def test_a_manoeuvre_is_predicted_better_than_by_constant_velocity() -> None:
    t = np.arange(330) * FRAME_NS * 1e-9
    circle = 3.0 * np.column_stack([np.cos(0.7 * t), np.sin(0.7 * t)])  # 1.5 m/s^2
    rmse = {}
    for name, config in (
        ("adaptive", TrackerConfig(gate_probability=0.999999)),
        ("plain", TrackerConfig(motion="constant-velocity", accel_sigma_mps2=2.0, gate_probability=0.999999)),
    ):
        followed, rng, off = Tracker(config, "world"), np.random.default_rng(8), []
        for k in range(300):
            (track,) = followed.step(k * FRAME_NS, [PlanarMeasurement(circle[k] + 0.02 * rng.normal(size=2), R)])
            if k > 60:
                ahead = {p.horizon_s: p for p in track.predictions}[1.0]
                off.append(ahead.xy_m - circle[k + 30])
                np.testing.assert_array_equal(
                    {p.horizon_s: p for p in track.predictions}[0.5].xy_m, track.predicted_xy_m
                )
        rmse[name] = np.sqrt(np.mean(np.square(off)))
    assert rmse["adaptive"] < 0.7 * rmse["plain"]
