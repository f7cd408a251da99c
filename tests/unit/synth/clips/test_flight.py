"""Drones: bounded, caused by their attitude, and in the end over the pad."""

from __future__ import annotations

import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.geometry import rotvec_from_rotation
from landtool.synth.clips.flight import STEP_S, Flight, leaning
from landtool.synth.clips.guidance import (
    BEFORE_S,
    GRAVITY_MPS2,
    HEIGHT_END_M,
    MOST_MPS2,
    MOST_TILT_RAD,
    Approach,
    fly,
)
from landtool.synth.clips.platform import PlatformMotion
from landtool.synth.clips.scenarios import SCENARIOS, ScenarioName
from landtool.synth.clips.wind import coloured, wind_mps

NAMES = tuple(SCENARIOS)
DRAG_PER_S = 0.12


def flown(name: ScenarioName, seed: int, wind: float, height_m: float = 6.0) -> tuple[PlatformMotion, Flight]:
    rng = np.random.default_rng(seed)
    motion = SCENARIOS[name](rng, 6.0, 0.5)
    return motion, fly(motion, Approach(6.0, height_m, name == "hover", wind), rng)


def times(flight: Flight) -> np.ndarray:
    return flight.start_s + np.arange(len(flight.yaws_rad)) * STEP_S


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("wind", [0.0, 4.0, 10.0])
def test_acceleration_and_tilt_are_bounded(name: ScenarioName, wind: float) -> None:
    for seed in (1, 2):
        _, flight = flown(name, seed, wind)
        assert np.linalg.norm(flight.accelerations_mps2, axis=1).max() <= MOST_MPS2
        assert np.abs(flight.tilts).max() <= MOST_TILT_RAD
        assert np.abs(flight.tilt_rates).max() <= 2.0 + 1e-9
        assert np.abs(flight.yaw_rates).max() <= 0.8
        for t in np.arange(0.0, 6.0, 0.37):
            up = flight.world_T_body(float(t)).rotation[2, 2]
            assert np.arccos(up) <= MOST_TILT_RAD + 2e-3  # and a trembling


@pytest.mark.parametrize("name", ["turn", "stop-and-go", "figure-eight"])
def test_the_attitude_causes_the_acceleration(name: ScenarioName) -> None:
    """Without wind, thrust along the body's z axis, gravity and drag add up to the motion that is seen."""
    _, flight = flown(name, 3, 0.0)
    for i in range(450, 1500, 25):
        t = flight.start_s + i * STEP_S
        seen = (flight.velocity_mps(t + STEP_S) - flight.velocity_mps(t)) / STEP_S
        thrust = leaning(complex(flight.tilts[i]), float(flight.yaws_rad[i]))[:, 2] * flight.thrusts_mps2[i]
        caused = thrust - [0.0, 0.0, GRAVITY_MPS2] - DRAG_PER_S * flight.velocities_mps[i]
        assert seen == pytest.approx(caused, abs=1e-6)
        # as anybody would see it from outside: a = g tan(tilt) on the level, but for drag and climb
        level = np.linalg.norm(seen[:2] + DRAG_PER_S * flight.velocities_mps[i, :2])
        up = flight.world_T_body(t).rotation[2, 2]
        lift = GRAVITY_MPS2 + seen[2] + DRAG_PER_S * flight.velocities_mps[i, 2]
        assert level == pytest.approx(lift * np.tan(np.arccos(up)), abs=0.02)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("wind", [0.0, 10.0])
def test_the_drone_comes_down_over_the_pad(name: ScenarioName, wind: float) -> None:
    for seed in (4, 5):
        motion, flight = flown(name, seed, wind)
        over = flight.positions_m - motion.positions_m(times(flight))
        first = round(BEFORE_S / STEP_S)
        assert over[first, 2] == pytest.approx(6.0, abs=0.45)
        late = over[first + round(5.8 / STEP_S) : first + round(6.0 / STEP_S)]
        assert np.hypot(late[:, 0], late[:, 1]).max() < 0.45
        assert late[:, 2] == pytest.approx(HEIGHT_END_M, abs=0.5 if name == "heave" else 0.12)
        assert over[:, 2].min() > 0.25


def test_hovering_waits_before_it_comes_down() -> None:
    _, flight = flown("hover", 6, 0.0)
    heights = [flight.world_T_body(t).translation[2] - 0.5 for t in (0.0, 0.9)]
    assert heights == pytest.approx([6.0, 6.0], abs=0.05)


def test_velocity_and_turning_are_derivatives_of_the_pose() -> None:
    _, flight = flown("figure-eight", 7, 5.0)
    for t in np.arange(-1.9, 6.4, 0.173):
        poses = [flight.world_T_body(float(t) + s) for s in (-1e-4, 1e-4)]
        moved = (poses[1].translation - poses[0].translation) / 2e-4
        assert flight.velocity_mps(float(t)) == pytest.approx(moved, abs=2e-3)
        turned = rotvec_from_rotation(poses[0].rotation.T @ poses[1].rotation) / 2e-4
        assert flight.rate_radps(float(t)) == pytest.approx(turned, abs=5e-3)


def test_the_heading_follows_loosely() -> None:
    motion, flight = flown("turn", 8, 0.0)
    off = flight.yaws_rad - motion.heading.at(times(flight))
    assert 0.02 < np.ptp(off) < 1.2


def test_times_outside_the_flight_are_refused() -> None:
    _, flight = flown("hover", 9, 0.0)
    flight.world_T_body(flight.start_s)
    flight.world_T_body(flight.end_s)
    for t in (flight.start_s - 0.01, flight.end_s + 0.01):
        with pytest.raises(ValueError, match="outside the flight"):
            flight.world_T_body(t)


def test_a_descent_without_the_time_for_it_is_refused_with_the_time_it_needs() -> None:
    motion = SCENARIOS["straight"](np.random.default_rng(0), 2.0, 0.5)
    with pytest.raises(UsageError, match=r"2 s are too short .* give at least 7 s") as refused:
        fly(motion, Approach(2.0, 20.0), np.random.default_rng(0))
    needed = float(refused.value.hint.split()[3])
    fly(motion, Approach(needed, 20.0), np.random.default_rng(0))


def test_gusts_have_the_strength_and_the_colour_they_say() -> None:
    rng = np.random.default_rng(10)
    level, up, mean = wind_mps(8.0, 60_000, STEP_S, rng)
    assert abs(mean) == pytest.approx(8.0)
    along = (level - mean) * np.conj(mean) / 8.0
    assert along.real.std() == pytest.approx(1.6, rel=0.2)
    assert up.std() == pytest.approx(0.8, rel=0.2)
    assert np.abs(along.real).max() <= 3.2 + 1e-9
    noise = coloured(60_000, STEP_S, 1.4, rng)
    later = [np.corrcoef(noise[:-lag], noise[lag:])[0, 1] for lag in (20, 2000)]
    assert later[0] > 0.97
    assert abs(later[1]) < 0.25


def test_no_wind_is_no_wind() -> None:
    level, up, mean = wind_mps(0.0, 50, STEP_S, np.random.default_rng(0))
    assert not level.any()
    assert not up.any()
    assert mean == 0
