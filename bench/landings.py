"""Landings without pictures: true motions, and measurements with the noise of each method, for trackers to follow."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array, Pose
from landtool.io.poses import STRAIGHT_DOWN, EgoPoses
from landtool.synth.clips.ego import EgoErrors
from landtool.synth.clips.guidance import Approach, fly
from landtool.synth.clips.scenarios import SCENARIOS, ScenarioName
from landtool.tracking.ego import EgoTrajectory
from landtool.types import PadPose, PoseMethod

DURATION_S, FPS, START_M, PAD_UP_M, WIND_MPS = 12.0, 30, 20.0, 0.5, 2.0
FRAMES = round(DURATION_S * FPS)
# standard deviations as a share of the distance: across the line of sight, along it; of the turn, rad
NOISE: dict[PoseMethod, tuple[float, float, float]] = {
    "box": (0.01, 0.05, 2.0),
    "target": (0.0015, 0.007, 0.026),
    "tag": (0.001, 0.004, 0.02),
}


@dataclass(frozen=True, eq=False)
class Landing:
    """One true landing. t_ns: (N,). camera_T_pad, world_T_pad: N each. ego: as the drone's odometry has it."""

    seed: int
    t_ns: NDArray[np.int64]
    world_T_pad: tuple[Pose, ...]
    camera_T_pad: tuple[Pose, ...]
    ego: EgoTrajectory

    def places_m(self, *, world: bool) -> Array:
        """Return the pad's true places (N, 2), in the world or in the body's axes."""
        if world:
            return np.array([pose.translation[:2] for pose in self.world_T_pad])
        return np.array([(STRAIGHT_DOWN @ pose).translation[:2] for pose in self.camera_T_pad])

    def measured(self, *, target_below_m: float, tag_below_m: float) -> Iterator[PadPose]:
        """Yield a pose a frame: by a box from afar, by the target between, by the tag from close by."""
        rng = np.random.default_rng((self.seed, 1))
        for true in self.camera_T_pad:
            distance = float(np.linalg.norm(true.translation))
            method: PoseMethod = "tag" if distance < tag_below_m else "target" if distance < target_below_m else "box"
            yield _noisy(true, method, rng)


def _noisy(true: Pose, method: PoseMethod, rng: np.random.Generator) -> PadPose:
    across, along, turn = NOISE[method]
    distance = float(np.linalg.norm(true.translation))
    ray = np.outer(true.translation, true.translation) / distance**2
    covariance = np.zeros((6, 6))
    # along the line of sight and across it: C = s_a^2 u u^T + s_c^2 (I - u u^T)
    covariance[:3, :3] = distance**2 * (along**2 * ray + across**2 * (np.eye(3) - ray))
    covariance[3:, 3:] = turn**2 * np.eye(3)
    step = np.linalg.cholesky(covariance) @ rng.normal(size=6)
    if method == "box":  # it does not say how the pad is turned
        step[3:] = 0.0
    return PadPose(true.perturbed(step), covariance, method, 0.0, 0.0)


@cache
def landings(scenario: ScenarioName, runs: int, first_seed: int = 1000) -> tuple[Landing, ...]:
    """Return landings of a scenario, from START_M to touchdown."""
    return tuple(_landing(scenario, first_seed + k) for k in range(runs))


def _landing(scenario: ScenarioName, seed: int) -> Landing:
    motion_rng, flight_rng, ego_rng = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(3))
    motion = SCENARIOS[scenario](motion_rng, DURATION_S, PAD_UP_M)
    flight = fly(motion, Approach(DURATION_S, START_M, wait=False, wind_mps=WIND_MPS), flight_rng)
    errors = EgoErrors.drawn(round(DURATION_S * 1e9), ego_rng)
    t_ns = np.arange(FRAMES, dtype=np.int64) * 1_000_000_000 // FPS
    pads = tuple(motion.world_T_pad(t / 1e9) for t in t_ns.tolist())
    bodies = [flight.world_T_body(t / 1e9) for t in t_ns.tolist()]
    cameras = tuple((body @ STRAIGHT_DOWN).inverse() @ pad for body, pad in zip(bodies, pads, strict=True))
    odometry = [errors.odometry(flight, t).world_T_body for t in errors.t_ns.tolist()]
    poses = EgoPoses(
        errors.t_ns,
        np.array([pose.translation for pose in odometry]),
        np.array([pose.quaternion_wxyz for pose in odometry]),
    )
    return Landing(seed, t_ns, pads, cameras, EgoTrajectory(poses))
