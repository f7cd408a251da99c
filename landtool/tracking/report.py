"""What a track says of itself in a frame: where it is, and where it will be."""

from __future__ import annotations

from landtool.tracking import mixture
from landtool.tracking.config import TrackerConfig
from landtool.tracking.kalman import KalmanState
from landtool.tracking.motion import Motion
from landtool.tracking.target import Target
from landtool.types import Prediction, Reference, Track


def report(target: Target, motion: Motion, config: TrackerConfig, reference: Reference, lead_s: float) -> Track:
    """Return a target as a track `lead_s` after its belief, with its predictions from there."""
    now = planar(target, motion, lead_s)
    ahead = {
        horizon_s: planar(target, motion, lead_s + horizon_s) for horizon_s in {config.horizon_s, *config.horizons_s}
    }
    predictions = tuple(
        Prediction(horizon_s, ahead[horizon_s].mean[:2], ahead[horizon_s].covariance[:2, :2])
        for horizon_s in config.horizons_s
    )
    return Track(
        target.track_id,
        target.status,
        reference,
        now.mean,
        now.covariance,
        target.nis,
        config.horizon_s,
        ahead[config.horizon_s].mean[:2],
        predictions,
    )


def planar(target: Target, motion: Motion, ahead_s: float) -> KalmanState:
    """Return place and velocity in the reference frame `ahead_s` later, each way of moving kept to till then."""
    belief, height = target.belief, target.height
    if ahead_s > 0.0:
        step = motion.step(ahead_s)
        means = (step.F @ belief.means[..., None])[..., 0]
        covariances = step.F @ belief.covariances @ step.F.swapaxes(-1, -2) + step.Q
        belief, height = mixture.Belief(belief.weights, means, covariances), height.after(ahead_s)
    mean, covariance = mixture.collapsed(belief)
    T = motion.output(height)
    P = T @ covariance @ T.T
    return KalmanState(T @ mean, 0.5 * (P + P.T))
