"""The drone's own odometry errs as it says, slowly in place and by a bias in attitude."""

from __future__ import annotations

import numpy as np
import pytest

from landtool.synth.clips.ego import BIAS_RAD, DRIFT_M, MARGIN_NS, NOISE_M, NOISE_RAD, PERIOD_NS, EgoErrors
from landtool.synth.clips.flight import Flight
from landtool.synth.clips.guidance import Approach, fly
from landtool.synth.clips.scenarios import SCENARIOS

LAST_NS = 5_966_666_667


@pytest.fixture(scope="module")
def flight() -> Flight:
    rng = np.random.default_rng(1)
    return fly(SCENARIOS["turn"](rng, 6.0, 0.5), Approach(6.0, 6.0, wind_mps=3.0), rng)


def test_it_begins_before_the_clip_and_ends_after_it_at_its_own_rate() -> None:
    errors = EgoErrors.drawn(LAST_NS, np.random.default_rng(0))
    assert errors.t_ns[0] == -MARGIN_NS
    assert LAST_NS + MARGIN_NS <= errors.t_ns[-1] < LAST_NS + MARGIN_NS + PERIOD_NS
    assert (np.diff(errors.t_ns) == PERIOD_NS).all()


def test_errors_have_the_size_they_are_documented_with() -> None:
    drawn = np.array([EgoErrors.drawn(LAST_NS, np.random.default_rng(seed)).values for seed in range(200)])
    place, attitude = drawn[:, :, :3], drawn[:, :, 3:6]
    first, last = (place[:, i].std() for i in (0, -1))
    assert first == pytest.approx(NOISE_M, rel=0.2)
    assert last == pytest.approx(np.hypot(NOISE_M, DRIFT_M * np.sqrt(6.38)), rel=0.15)
    # what is left of a step is the white part: drift is slow
    assert np.diff(place, axis=1).std() == pytest.approx(np.hypot(np.sqrt(2.0) * NOISE_M, DRIFT_M * 0.1414), rel=0.05)
    assert attitude.mean(axis=1).std() == pytest.approx(BIAS_RAD, rel=0.15)
    assert attitude.std(axis=1).mean() == pytest.approx(NOISE_RAD, rel=0.05)
    assert np.degrees(np.hypot(BIAS_RAD, NOISE_RAD)) == pytest.approx(0.3, abs=0.01)


def test_it_is_the_truth_with_those_errors_and_says_how_large_they_are(flight: Flight) -> None:
    squares, turns = [], []
    for seed in range(40):
        errors = EgoErrors.drawn(LAST_NS, np.random.default_rng(seed))
        for t_ns in errors.t_ns[[10, 150, 300]].tolist():
            own, true = errors.odometry(flight, t_ns), flight.world_T_body(t_ns / 1e9)
            squares.append((own.world_T_body.translation - true.translation) ** 2 / own.pose_variances[:3])
            turns.append(own.world_T_body.angle_to(true) ** 2 / own.pose_variances[3:].sum())
            # velocities are along the body's axes
            off = own.world_T_body.rotation @ own.velocity_mps - flight.velocity_mps(t_ns / 1e9)
            assert np.abs(off).max() < 0.2
            assert np.abs(own.rate_radps - flight.rate_radps(t_ns / 1e9)).max() < 0.05
    assert np.mean(squares) == pytest.approx(1.0, abs=0.25)
    assert np.mean(turns) == pytest.approx(1.0, abs=0.3)


def test_between_two_of_its_times_the_errors_are_between_theirs(flight: Flight) -> None:
    errors = EgoErrors.drawn(LAST_NS, np.random.default_rng(3))
    t_ns = int(errors.t_ns[20])
    at = [t_ns, t_ns + PERIOD_NS // 2, t_ns + PERIOD_NS]
    off = [errors.odometry(flight, t).world_T_body.translation - flight.world_T_body(t / 1e9).translation for t in at]
    assert off[1] == pytest.approx((off[0] + off[2]) / 2.0, abs=1e-12)
