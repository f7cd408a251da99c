"""How platforms move: one function a scenario, in the table `SCENARIOS`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, get_args

import numpy as np

from landtool.synth.clips.curve import Curve, Ramp, Wave
from landtool.synth.clips.platform import PlatformMotion

ScenarioName = Literal["straight", "turn", "stop-and-go", "figure-eight", "heave", "hover", "occlusion"]
# draws a motion: generator, duration of the clip in s, height of the pad over the ground at rest in m
Scenario = Callable[[np.random.Generator, float, float], PlatformMotion]

_SIDEWAYS_MPS2 = 1.6  # what a drone that bounds its own acceleration can follow
# sin-shaped headings of this amplitude, the first zero of Bessel's J0, close to an eight
_EIGHT_RAD = 2.404826


def _straight(rng: np.random.Generator, _: float, height_m: float) -> PlatformMotion:
    """Return a drive along x, its speed and heading nearly steady."""
    speed = float(rng.uniform(1.0, 6.0))
    hunting = Wave(0.05 * speed, float(rng.uniform(0.4, 1.2)), _phase(rng))
    weaving = Wave(math.radians(float(rng.uniform(0.2, 1.0))), float(rng.uniform(0.4, 1.0)), _phase(rng))
    return _road(rng, Curve(speed, waves=(hunting,)), Curve(waves=(weaving,)), height_m)


def _turn(rng: np.random.Generator, duration_s: float, height_m: float) -> PlatformMotion:
    """Return a drive into a bend, to either side, and out of it."""
    speed = float(rng.uniform(1.0, 3.5))
    start, end = 0.15 * duration_s, float(rng.uniform(0.8, 0.95)) * duration_s
    # the steepest slope of the ramp is 15 / 8 of its mean; v w <= a
    most = _SIDEWAYS_MPS2 / speed * (end - start) / 1.875
    angle = min(float(rng.uniform(0.8, 1.9)), most) * _side(rng)
    return _road(rng, Curve(speed), Curve(ramps=(Ramp(start, end, angle),)), height_m)


def _stop_and_go(rng: np.random.Generator, duration_s: float, height_m: float) -> PlatformMotion:
    """Return a drive that brakes to a stop, stands, and goes on."""
    brake_s, stand_s = (float(rng.uniform(*r)) * duration_s for r in ((0.25, 0.32), (0.08, 0.2)))
    stop = float(rng.uniform(0.1, 0.2)) * duration_s
    # 15 / 8 v / t <= a
    speed = min(float(rng.uniform(1.5, 5.0)), _SIDEWAYS_MPS2 * brake_s / 1.875)
    go = stop + brake_s + stand_s
    ramps = (Ramp(stop, stop + brake_s, -speed), Ramp(go, go + brake_s, speed))
    return _road(rng, Curve(speed, ramps=ramps), Curve(), height_m)


def _figure_eight(rng: np.random.Generator, _: float, height_m: float) -> PlatformMotion:
    """Return laps of a figure eight."""
    lap_s = float(rng.uniform(12.0, 20.0))
    rate = 2.0 * math.pi / lap_s
    speed = min(float(rng.uniform(1.2, 3.0)), _SIDEWAYS_MPS2 / (_EIGHT_RAD * rate))
    heading = Curve(waves=(Wave(_EIGHT_RAD * _side(rng), rate, _phase(rng)),))
    return _road(rng, Curve(speed), heading, height_m)


def _heave(rng: np.random.Generator, _: float, height_m: float) -> PlatformMotion:
    """Return a boat's deck in a swell: it goes slowly ahead, up and down, rolls and pitches."""

    def swell(amplitude: float) -> Curve:
        # a swell and a shorter sea on top of it, not in a fixed ratio
        long, short = float(rng.uniform(0.9, 1.5)), float(rng.uniform(1.8, 2.8))
        share = float(rng.uniform(0.15, 0.3))
        return Curve(waves=(Wave(amplitude, long, _phase(rng)), Wave(share * amplitude, short, _phase(rng))))

    bob = swell(float(rng.uniform(0.15, 0.4)))
    roll = swell(math.radians(float(rng.uniform(3.0, 7.0))))
    pitch = swell(math.radians(float(rng.uniform(1.0, 3.5))))
    yaw = swell(math.radians(float(rng.uniform(0.5, 2.0))))
    # the deck stays above the water at its lowest
    height = Curve(max(height_m, sum(w.amplitude for w in bob.waves) + 0.1), waves=bob.waves)
    return PlatformMotion(Curve(float(rng.uniform(1.0, 2.5))), yaw, height, roll, pitch)


def _hover(_: np.random.Generator, __: float, height_m: float) -> PlatformMotion:
    """Return a platform that stands."""
    return PlatformMotion(Curve(), Curve(), Curve(height_m))


def _occlusion(rng: np.random.Generator, duration_s: float, height_m: float) -> PlatformMotion:
    """Return a straight drive below something that hides the pad for half a second to a second."""
    middle = float(rng.uniform(0.3, 0.45)) * duration_s
    half = min(float(rng.uniform(0.5, 1.0)), 0.4 * duration_s) / 2.0
    speed = Curve(float(rng.uniform(1.5, 4.0)))
    return PlatformMotion(speed, Curve(), *_bumps(rng, height_m), hidden_s=(middle - half, middle + half))


SCENARIOS: dict[ScenarioName, Scenario] = {
    "straight": _straight,
    "turn": _turn,
    "stop-and-go": _stop_and_go,
    "figure-eight": _figure_eight,
    "heave": _heave,
    "hover": _hover,
    "occlusion": _occlusion,
}
assert tuple(SCENARIOS) == get_args(ScenarioName)


def _road(rng: np.random.Generator, speed: Curve, heading: Curve, height_m: float) -> PlatformMotion:
    return PlatformMotion(speed, heading, *_bumps(rng, height_m))


def _bumps(rng: np.random.Generator, height_m: float) -> tuple[Curve, Curve, Curve]:
    """Return height, roll and pitch of a vehicle on its springs."""
    up, roll, pitch = (
        tuple(Wave(size * float(rng.uniform(0.3, 1.0)), rate, _phase(rng)) for rate in rng.uniform(4.0, 9.0, 2))
        for size in (0.006, math.radians(0.5), math.radians(0.4))
    )
    return Curve(height_m, waves=up), Curve(waves=roll), Curve(waves=pitch)


def _phase(rng: np.random.Generator) -> float:
    return float(rng.uniform(0.0, 2.0 * math.pi))


def _side(rng: np.random.Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0
