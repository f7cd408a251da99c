"""A drone that comes down on a moving platform: what it knows, what it wants, and what its body does about it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landtool.errors import UsageError
from landtool.geometry import Array
from landtool.synth.clips.curve import Curve, Ramp, Wave
from landtool.synth.clips.flight import STEP_S, Flight
from landtool.synth.clips.platform import Level, PlatformMotion
from landtool.synth.clips.wind import coloured, wind_mps

GRAVITY_MPS2 = 9.81
MOST_MPS2 = 4.0  # acceleration of the drone, gusts included
MOST_TILT_RAD = math.radians(25.0)
HEIGHT_END_M = 0.6
BEFORE_S, AFTER_S = 2.0, 0.5  # flown before the first picture and after the last

_WANTED_MPS2 = 3.2  # gusts may add to it
_LOWERED_MPS, _LOWERED_MPS2 = 4.0, 2.5
_DRAG_PER_S = 0.12
_DELAY_S = 0.12
# gains on place, velocity, and the platform's own acceleration; critically damped, about 1.5 rad/s
_KP, _KD, _KA = 2.2, 2.9, 0.9
_KP_UP, _KD_UP = 4.0, 4.0
_FOLLOW_UP_S = 0.5
# the body's answer to a wanted tilt: second order
_TILT_RADPS, _TILT_DAMPING, _MOST_TILT_RADPS = 11.0, 0.9, 2.0
_YAW_RADPS, _MOST_YAW_RADPS = 1.2, 0.8
_THRUST_S = 0.04
_THRUSTS_MPS2 = (0.4 * GRAVITY_MPS2, 1.7 * GRAVITY_MPS2)


@dataclass(frozen=True)
class Approach:
    """What the drone is to do: come down from a height over the pad in a time, in a wind (mean, m/s).

    duration_s: of the clip; height_start_m is reached at its start, HEIGHT_END_M just before its end.
    wait: whether it stays at its first height for a while.
    """

    duration_s: float
    height_start_m: float
    wait: bool = False
    wind_mps: float = 0.0


def refuse_steep(approach: Approach) -> None:
    """Raise UsageError when there is not the time for so deep a descent."""
    rate = _sinking(approach)
    t = np.arange(0.0, approach.duration_s, STEP_S)
    # speeds go with 1 / duration, accelerations with its square
    longer = max(float(rate.at(t).max()) / _LOWERED_MPS, math.sqrt(float(np.abs(rate.rate(t)).max()) / _LOWERED_MPS2))
    if longer > 1.0:
        reason = f"{approach.duration_s:g} s are too short to come down from {approach.height_start_m:g} m"
        need = math.ceil(10.0 * approach.duration_s * longer) / 10.0
        raise UsageError(reason, hint=f"give at least {need:g} s or start lower")


def fly(motion: PlatformMotion, approach: Approach, rng: np.random.Generator) -> Flight:
    """Return the flight over a platform, from BEFORE_S before the clip to AFTER_S after it.

    Raises UsageError as `refuse_steep`.
    """
    refuse_steep(approach)
    first, last = -round(BEFORE_S / STEP_S), round((approach.duration_s + AFTER_S) / STEP_S) + 1
    times: Array = np.arange(first, last + 1, dtype=np.float64) * STEP_S
    known = _knowledge(motion, approach, times, rng)
    gusts, gusts_up, mean = wind_mps(approach.wind_mps, len(times), STEP_S, rng)
    state = _State(
        place=complex(known.place[0]),
        velocity=complex(known.velocity[0]),
        up=float(known.up[0]),
        up_velocity=float(known.up_velocity[0]),
        yaw=float(known.yaw[0]),
    )
    rows = []
    for i in range(len(times)):
        rows.append(_step(state, known, i, (complex(gusts[i]), float(gusts_up[i]), mean)))
    place, velocity, acceleration, thrust, tilt, tilt_rate, yaw, yaw_rate = zip(*rows, strict=True)
    return Flight(
        float(times[0]),
        np.array(place),
        np.array(velocity),
        np.array(acceleration),
        np.array(thrust),
        np.array(tilt),
        np.array(tilt_rate),
        np.array(yaw),
        np.array(yaw_rate),
        _shake(rng),
    )


@dataclass(frozen=True, eq=False)
class _Knowledge:
    """What the drone steers by, (N,) each: level place, velocity, acceleration as x + iy; height and its rates."""

    place: Level
    velocity: Level
    acceleration: Level
    up: Array
    up_velocity: Array
    up_acceleration: Array
    yaw: Array


def _knowledge(motion: PlatformMotion, approach: Approach, t: Array, rng: np.random.Generator) -> _Knowledge:
    """Return where the drone wants to be: over the pad as it was a while ago, carried on, with errors."""
    seen, moving = motion.positions_m(t - _DELAY_S), motion.velocities_mps(t - _DELAY_S)
    over, sinking, braking = _heights(approach, t)
    velocity = moving[:, 0] + 1j * moving[:, 1]
    acceleration = np.gradient(velocity, STEP_S)
    # p + v d + a d^2 / 2, v + a d
    ahead = _DELAY_S * velocity + 0.5 * _DELAY_S**2 * acceleration
    velocity = velocity + _DELAY_S * acceleration
    # far away the pad is known less well
    error, drift = (_level_noise(len(t), scale_s, rng) for scale_s in (1.0, 0.5))
    place = seen[:, 0] + 1j * seen[:, 1] + ahead + error * (0.015 + 0.006 * over)
    aside = rng.uniform(0.03, 0.12) * approach.height_start_m * np.exp(1j * rng.uniform(0.0, 2.0 * np.pi))
    coming = Curve(1.0, ramps=(Ramp(0.0, 0.65 * approach.duration_s, -1.0),))
    up, up_velocity = _followed(seen[:, 2], moving[:, 2])
    return _Knowledge(
        np.asarray(place + aside * coming.at(t)),
        np.asarray(velocity + 0.05 * drift),
        acceleration,
        up + over,
        up_velocity + sinking,
        braking,
        motion.heading.at(t - _DELAY_S) + rng.uniform(-0.5, 0.5),
    )


def _level_noise(steps: int, scale_s: float, rng: np.random.Generator) -> Level:
    one, two = (coloured(steps, STEP_S, scale_s, rng) for _ in range(2))
    return np.asarray(one + 1j * two)


def _followed(height: Array, rate: Array) -> tuple[Array, Array]:
    """Return the pad's height (N,) and its rate as a drone follows it: not every wave, but the swell."""
    up, last = np.empty_like(height), float(height[0])
    for i, (h, v) in enumerate(zip(height.tolist(), rate.tolist(), strict=True)):
        last += (h + 0.5 * _FOLLOW_UP_S * v - last) * STEP_S / _FOLLOW_UP_S
        up[i] = last
    return up, np.gradient(up, STEP_S)


def _sinking(approach: Approach) -> Curve:
    """Return the speed of the descent during the clip."""
    d = approach.duration_s
    drop = approach.height_start_m - HEIGHT_END_M
    # a ramp's mean is half its rise
    if approach.wait:
        speed = drop / (0.4 * d)
        return Curve(ramps=(Ramp(0.15 * d, 0.5 * d, speed), Ramp(0.5 * d, 0.95 * d, -speed)))
    speed = drop / (0.7 * d)
    return Curve(speed, ramps=(Ramp(0.45 * d, 0.95 * d, -speed),))


def _heights(approach: Approach, t: Array) -> tuple[Array, Array, Array]:
    """Return the wanted height over the pad (N,), its rate and its acceleration."""
    sinking = _sinking(approach)
    rate = sinking.at(t)
    sunk = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2.0) * STEP_S])
    sunk -= np.interp(0.0, t, sunk)
    return approach.height_start_m - sunk, -rate, -sinking.rate(t)


@dataclass
class _State:
    """The drone now. Level coordinates are x + iy."""

    place: complex
    velocity: complex
    up: float
    up_velocity: float
    yaw: float
    tilt: complex = 0j
    tilt_rate: complex = 0j
    yaw_rate: float = 0.0
    thrust: float = GRAVITY_MPS2


_Row = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...], float, complex, complex, float, float]


def _step(s: _State, known: _Knowledge, i: int, wind: tuple[complex, float, complex]) -> _Row:
    """Return the state and what it does during the step, and take the step."""
    gust, gust_up, mean = wind
    want, want_up = _wanted(s, known, i)
    # the drag that the mean wind causes is known, and leant against
    push = want - _DRAG_PER_S * (mean - s.velocity)
    lift = want_up + GRAVITY_MPS2 + _DRAG_PER_S * s.up_velocity
    lean = abs(s.tilt)
    way = s.tilt / lean if lean else 0j
    # a = f z_body - g + drag
    level = s.thrust * math.sin(lean) * way + _DRAG_PER_S * (gust - s.velocity)
    upward = s.thrust * math.cos(lean) - GRAVITY_MPS2 + _DRAG_PER_S * (gust_up - s.up_velocity)
    row = (
        (s.place.real, s.place.imag, s.up),
        (s.velocity.real, s.velocity.imag, s.up_velocity),
        (level.real, level.imag, upward),
        s.thrust,
        s.tilt,
        s.tilt_rate,
        s.yaw,
        s.yaw_rate,
    )
    s.place += STEP_S * (s.velocity + 0.5 * STEP_S * level)
    s.up += STEP_S * (s.up_velocity + 0.5 * STEP_S * upward)
    s.velocity += STEP_S * level
    s.up_velocity += STEP_S * upward
    _turn(s, _limited(push / (abs(push) or 1.0) * math.atan2(abs(push), lift), MOST_TILT_RAD), float(known.yaw[i]))
    low, high = _THRUSTS_MPS2
    s.thrust += (min(max(lift / math.cos(abs(s.tilt)), low), high) - s.thrust) * STEP_S / _THRUST_S
    return row


def _wanted(s: _State, known: _Knowledge, i: int) -> tuple[complex, float]:
    """Return the acceleration the drone wants, on the level and upwards."""
    off, slip = complex(known.place[i]) - s.place, complex(known.velocity[i]) - s.velocity
    want = _KP * _limited(off, 1.5) + _KD * slip + _KA * complex(known.acceleration[i])
    high, rising = float(known.up[i]) - s.up, float(known.up_velocity[i]) - s.up_velocity
    want_up = _KP_UP * high + _KD_UP * rising + float(known.up_acceleration[i])
    less = min(1.0, _WANTED_MPS2 / max(math.hypot(abs(want), want_up), 1e-9))
    return less * want, less * want_up


def _turn(s: _State, tilt: complex, yaw: float) -> None:
    """Turn the body for a step, towards a wanted tilt and yaw."""
    bending = _TILT_RADPS**2 * (tilt - s.tilt) - 2.0 * _TILT_DAMPING * _TILT_RADPS * s.tilt_rate
    s.tilt_rate = _limited(s.tilt_rate + STEP_S * bending, _MOST_TILT_RADPS)
    leant = _limited(s.tilt + STEP_S * s.tilt_rate, MOST_TILT_RAD)
    s.tilt_rate, s.tilt = (leant - s.tilt) / STEP_S, leant
    twisting = _YAW_RADPS**2 * (yaw - s.yaw) - 2.0 * _YAW_RADPS * s.yaw_rate
    s.yaw_rate = min(max(s.yaw_rate + STEP_S * twisting, -_MOST_YAW_RADPS), _MOST_YAW_RADPS)
    s.yaw += STEP_S * s.yaw_rate


def _limited(value: complex, most: float) -> complex:
    """Return a vector, made shorter if it is longer than `most`."""
    length = abs(value)
    return value if length <= most else value * (most / length)


def _shake(rng: np.random.Generator) -> tuple[Curve, Curve, Curve]:
    """Return the trembling of a body under its rotors, rad about its axes."""

    def axis(size_rad: float) -> Curve:
        rates = 2.0 * math.pi * rng.uniform(20.0, 60.0, 3)
        return Curve(waves=tuple(Wave(size_rad * float(rng.uniform(0.3, 1.0)), float(r), float(rng.uniform(0.0, 6.28)))
                                 for r in rates))  # fmt: skip

    return axis(2.5e-4), axis(2.5e-4), axis(1.0e-4)
