"""Platforms: their motion is smooth, their velocity and turning are its derivatives, their speeds are bounded."""

from __future__ import annotations

import numpy as np
import pytest

from landtool.geometry import rotvec_from_rotation
from landtool.synth.clips.curve import Curve, Ramp, Wave
from landtool.synth.clips.scenarios import SCENARIOS, ScenarioName

NAMES = tuple(SCENARIOS)
DURATION_S, HEIGHT_M = 6.0, 0.7
TIMES = np.linspace(-2.0, DURATION_S + 1.0, 37)


def motions(name: ScenarioName, count: int = 4):
    return [SCENARIOS[name](np.random.default_rng(seed), DURATION_S, HEIGHT_M) for seed in range(count)]


def test_a_curve_is_the_sum_of_its_parts_and_its_rate_the_slope_of_it() -> None:
    curve = Curve(1.0, 0.5, (Wave(0.3, 2.0, 0.4),), (Ramp(1.0, 3.0, -2.0),))
    assert curve.at(0.0) == pytest.approx(1.0 + 0.3 * np.sin(0.4))
    assert curve.at(4.0) == pytest.approx(1.0 + 2.0 + 0.3 * np.sin(8.4) - 2.0)
    t = np.linspace(-1.0, 5.0, 61)
    assert curve.rate(t) == pytest.approx((curve.at(t + 1e-5) - curve.at(t - 1e-5)) / 2e-5, abs=1e-8)


def test_a_ramp_starts_and_ends_without_a_jerk() -> None:
    ramp, h = Curve(ramps=(Ramp(0.0, 1.0, 1.0),)), 1e-4
    for t in (0.0, 1.0):
        bends = [(ramp.rate(t + s * h) - ramp.rate(t)) / (s * h) for s in (-1.0, 1.0)]
        assert np.abs(bends).max() < 0.01


@pytest.mark.parametrize("name", NAMES)
def test_velocity_is_the_derivative_of_the_place(name: ScenarioName) -> None:
    for motion in motions(name):
        measured = (motion.positions_m(TIMES + 1e-4) - motion.positions_m(TIMES - 1e-4)) / 2e-4
        assert motion.velocities_mps(TIMES) == pytest.approx(measured, abs=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_turning_is_the_derivative_of_the_attitude(name: ScenarioName) -> None:
    for motion in motions(name, 2):
        for t in TIMES[::4]:
            before, after = (motion.world_T_pad(float(t) + s * 1e-4).rotation for s in (-1.0, 1.0))
            measured = rotvec_from_rotation(before.T @ after) / 2e-4
            assert motion.rate_radps(float(t)) == pytest.approx(measured, abs=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_accelerations_have_no_jumps(name: ScenarioName) -> None:
    step = 1e-3
    t = np.arange(-1.0, DURATION_S + 1.0, step)
    for motion in motions(name, 2):
        acceleration = np.diff(motion.velocities_mps(t), axis=0) / step
        # the jerk of the steepest ramp is some 50 m/s3; a jump of 0.1 m/s2 in one step would be 100
        assert np.abs(np.diff(acceleration, axis=0)).max() / step < 60.0


@pytest.mark.parametrize("name", NAMES)
def test_speeds_are_those_of_vehicles_and_the_pad_starts_over_the_origin(name: ScenarioName) -> None:
    for motion in motions(name):
        speeds = motion.speed.at(TIMES)
        assert speeds.min() >= (0.0 if name in ("hover", "stop-and-go") else 0.9)
        assert speeds.max() <= 6.4
        assert motion.positions_m(0.0)[0, :2] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_pad_looks_where_it_goes() -> None:
    for name in ("straight", "turn", "figure-eight"):
        for motion in motions(name):  # type: ignore[arg-type]
            for t in (0.3, 2.0, 5.0):
                along = motion.world_T_pad(t).rotation[:2, 0]
                velocity = motion.velocities_mps(t)[0, :2]
                assert along @ velocity / np.linalg.norm(velocity) > 0.9995


def test_what_the_scenarios_are_named_after() -> None:
    t = np.linspace(0.0, DURATION_S, 601)
    for seed in range(5):
        drawn = {name: make(np.random.default_rng(seed), DURATION_S, HEIGHT_M) for name, make in SCENARIOS.items()}
        headings = {name: motion.heading.at(t) for name, motion in drawn.items()}
        assert np.ptp(headings["straight"]) < 0.05
        assert abs(headings["turn"][-1] - headings["turn"][0]) > 0.5
        speed = drawn["stop-and-go"].speed.at(t)
        assert speed.min() < 1e-9 < 1.0 < min(speed[0], speed[-1])
        deck = drawn["heave"]
        assert np.ptp(deck.height.at(t)) > 0.15
        assert np.ptp(deck.roll.at(t)) > np.radians(2.0)
        assert deck.height.at(np.linspace(0, 300, 9000)).min() > 0.09
        assert np.ptp(drawn["hover"].positions_m(t), axis=0)[:2].max() == 0.0
        hidden = drawn["occlusion"].hidden_s
        assert hidden is not None
        assert 0.5 <= hidden[1] - hidden[0] <= 1.0
        assert 0.0 < hidden[0] < hidden[1] < DURATION_S


def test_a_figure_eight_closes() -> None:
    motion = SCENARIOS["figure-eight"](np.random.default_rng(1), DURATION_S, HEIGHT_M)
    lap_s = 2.0 * np.pi / motion.heading.waves[0].rate_radps
    start, end = motion.positions_m([1.0, 1.0 + lap_s])[:, :2]
    assert end == pytest.approx(start, abs=1e-5)
    # to the left as far as to the right
    assert np.ptp(motion.heading.at(np.linspace(0, lap_s, 400))) == pytest.approx(2 * 2.404826, abs=0.01)


def test_places_do_not_depend_on_what_was_asked_before() -> None:
    one, two = motions("turn", 1)[0], motions("turn", 1)[0]
    far = one.positions_m([-3.0, 40.0])
    assert np.array_equal(one.positions_m(2.345), two.positions_m(2.345))
    assert np.array_equal(far, two.positions_m([-3.0, 40.0]))
