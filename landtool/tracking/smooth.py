"""A finished run once more, from its end: what later frames say about earlier ones.

Rauch, Tung, Striebel: Maximum likelihood estimates of linear dynamic systems, AIAA Journal 3 (1965). Where a platform
may move in several ways, they are weighed by what the whole run says about each, and the smoother is that of the
linear motion which is their mean.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from landtool.geometry import Array
from landtool.tracking import mixture
from landtool.tracking.kalman import KalmanState
from landtool.tracking.measurement import PlanarMeasurement
from landtool.tracking.mixture import Belief, Step
from landtool.tracking.motion import Motion
from landtool.tracking.vertical import Vertical


@dataclass(frozen=True, eq=False)
class RecordedStep:
    """What one step of a tracker was given and gave: a few hundred bytes.

    t_ns: of the measurements, None without a clock. taken: the number of the track each measurement went to. living:
    the numbers of the tracks that were reported.
    """

    t_ns: int | None
    measurements: tuple[PlanarMeasurement, ...]
    taken: tuple[int, ...]
    living: tuple[int, ...]


@dataclass(eq=False)
class _Node:
    """One time of one track. rows: the steps whose row is for this time. step: how the state changed to it."""

    t_ns: int
    seen: list[PlanarMeasurement] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)
    step: Step | None = None
    belief: Belief | None = None
    height: Vertical | None = None


def smooth(
    steps: Sequence[RecordedStep], motion: Motion, *, since_ns: int | None = None, lead_ns: int = 0
) -> dict[tuple[int, int], KalmanState]:
    """Return place and velocity in the reference frame at each (index of the step, number of the track) with a row.

    since_ns: from when on the drone's own place has drifted. lead_ns: how much later than its measurements a row is.
    """
    smoothed: dict[tuple[int, int], KalmanState] = {}
    for track_id, nodes in _nodes(steps, lead_ns).items():
        states = _smoothed(nodes, motion, since_ns)
        for node, state in zip(nodes, states, strict=True):
            smoothed.update({(row, track_id): state for row in node.rows})
    return smoothed


def _nodes(steps: Sequence[RecordedStep], lead_ns: int) -> dict[int, list[_Node]]:
    """Return the times of each track, in order, from its first measurement on."""
    tracks: dict[int, dict[int, _Node]] = defaultdict(dict)
    for index, step in enumerate(steps):
        if step.t_ns is None:
            continue
        for seen, track_id in zip(step.measurements, step.taken, strict=True):
            tracks[track_id].setdefault(step.t_ns, _Node(step.t_ns)).seen.append(seen)
        for track_id in step.living:
            row_ns = step.t_ns + lead_ns
            tracks[track_id].setdefault(row_ns, _Node(row_ns)).rows.append(index)
    return {track_id: _from_first([by_time[t_ns] for t_ns in sorted(by_time)]) for track_id, by_time in tracks.items()}


def _from_first(nodes: list[_Node]) -> list[_Node]:
    first = next((i for i, node in enumerate(nodes) if node.seen), len(nodes))
    return nodes[first:]


def _smoothed(nodes: list[_Node], motion: Motion, since_ns: int | None) -> list[KalmanState]:
    """Return the state at each node."""
    if not nodes:
        return []
    age_s = 0.0 if since_ns is None else max(0.0, (nodes[0].t_ns - since_ns) * 1e-9)
    _forward(nodes, motion, age_s)
    if len(motion.weights) > 1:
        _weigh(nodes)
        _forward(nodes, motion, age_s)
    return _backward(nodes, motion)


def _forward(nodes: list[_Node], motion: Motion, age_s: float) -> None:
    """Filter along the nodes, keeping each node's belief, and its step where it is not known yet."""
    first = nodes[0]
    belief = motion.begin(first.seen[0], age_s)
    if first.step is not None:
        belief = Belief(np.ones(1), belief.means[:1], belief.covariances[:1])
    height = Vertical.begun(first.seen[0].z_m, first.seen[0].z_variance_m2)
    seen = first.seen[1:]
    for i, node in enumerate(nodes):
        if i:
            dt_s = (node.t_ns - nodes[i - 1].t_ns) * 1e-9
            node.step = node.step or motion.step(dt_s)
            belief, height, seen = mixture.advanced(belief, node.step), height.after(dt_s), node.seen
        for measurement in seen:
            z, H, R = measurement.xy_m, motion.sight(measurement), measurement.covariance
            belief, _ = mixture.updated(belief, z, H, R, motion.learnt)
            height = height.measured(measurement.z_m, measurement.z_variance_m2)
        node.belief, node.height = belief, height


def _weigh(nodes: list[_Node]) -> None:
    """Make each node's step the mean of its ways of moving, by what the whole run says about them."""
    last = nodes[-1].belief
    assert last is not None
    later = last.weights
    for node, before in zip(reversed(nodes), [*reversed(nodes[:-1]), None], strict=True):
        step = node.step
        if before is None or step is None:
            node.step = Step(np.zeros((1, 0, 0)), np.zeros((1, 0, 0)), np.eye(1))
            break
        node.step = Step(
            np.einsum("j,jab->ab", later, step.F)[None], np.einsum("j,jab->ab", later, step.Q)[None], np.eye(1)
        )
        assert before.belief is not None
        # mu_k(i | all) = mu_k(i) sum_j pi_ij mu_k+1(j | all) / c_k+1(j), c as predicted
        predicted = before.belief.weights @ step.switching
        weights = before.belief.weights * (step.switching @ (later / predicted))
        later = weights / weights.sum()


def _backward(nodes: list[_Node], motion: Motion) -> list[KalmanState]:
    """Return the smoothed place and velocity at each node."""
    states: list[KalmanState] = []
    mean, covariance = np.zeros(0), np.zeros((0, 0))
    for i in range(len(nodes) - 1, -1, -1):
        belief, height = nodes[i].belief, nodes[i].height
        assert belief is not None
        assert height is not None
        x, P = belief.means[0], belief.covariances[0]
        if i + 1 < len(nodes):
            step = nodes[i + 1].step
            assert step is not None
            x, P = _gained(x, P, step.F[0], step.Q[0], mean, covariance, motion.learnt)
        mean, covariance = x, P
        T = motion.output(height)
        placed = T @ P @ T.T
        states.append(KalmanState(T @ x, 0.5 * (placed + placed.T)))
    return states[::-1]


def _gained(
    x: Array, P: Array, F: Array, Q: Array, later: Array, later_P: Array, learnt: Array | None
) -> tuple[Array, Array]:
    # C = P F^T P'^-1 with P' = F P F^T + Q;  x_s = x + C (x_s+1 - F x),  P_s = P + C (P_s+1 - P') C^T
    ahead = F @ P @ F.T + Q
    gain = P @ F.T @ np.linalg.pinv(ahead, rcond=1e-14, hermitian=True)
    if learnt is not None:  # what is only considered stays as it is, as it does in the filter
        held = np.diag(1.0 - learnt)
        gain = gain * learnt[:, None] + held
    covariance = P + gain @ (later_P - ahead) @ gain.T
    return x + gain @ (later - F @ x), 0.5 * (covariance + covariance.T)
