"""One pad from frame to frame: which of its possible poses is the true one.

Two doubts are settled over time: the mirror image of a plane seen from afar, by hypotheses of its orientation
(landtool.landing.turns; of tags alone by landtool.tags.choose), and half a turn about the pad's normal, which ring and
H leave open and the pixels of the unread tag tell a little about in each frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from landtool.geometry import Array, Pose, rotvec_from_rotation
from landtool.landing import turns
from landtool.landing.measure import HALF_TURN, PadMeasurer, mirrored, with_doubt
from landtool.landing.turns import Turn
from landtool.tags.choose import SolutionChooser
from landtool.tags.pose import Solution
from landtool.target.register import Registered
from landtool.types import Image, PadPose

# Errors repeat from frame to frame, so a frame is worth less than its likelihood says, and never everything
_WORTH, _MOST_FIT = 0.3, 6.0
_WORTH_S = 0.3  # ... and those within such a time as much as one
_HEADING_WORTH, _MOST_HEADING = 0.4, 3.0
_HEADING_DECIDED, _HEADING_BACK = 7.0, 1.0
_MOST_TURNS = 2
_MIRROR_EVERY_S, _MIRROR_PX = 0.3, 110.0  # wider pads show their tilt in perspective
_GIVEN_UP = 3.0  # what speaks against a mirror image that was there before
_SURPRISE = 12.0  # five standard deviations
HEADING_OPEN = "the pad's heading may be off by half a turn"
MIRROR_KEPT = "kept the solution the past supports, its mirror image fits better"


class PadFollower:
    """Keeps what is known of one pad's orientation. body_T_camera: the camera's mount."""

    def __init__(self, body_T_camera: Pose) -> None:
        self._body_T_camera = body_T_camera
        self._chooser = SolutionChooser(body_T_camera)
        self._turns: tuple[Turn, ...] = ()
        self._last_ns: int | None = None
        self._in_world = False
        self._mirror_ns: int | None = None
        self._worth = _WORTH
        self._before: Registered | None = None
        self._heading_odds, self._heading_begun = 0.0, False
        self.heading_known = False
        self.tag_was_read = False
        self.unread = 0  # frames in which a tag could have been read, and was not

    def by_tag(self, solutions: Sequence[Solution], t_ns: int | None, world_T_body: Pose | None) -> tuple[PadPose, str]:
        """Return the pose to believe of those a read tag gives, and what a log should say of it."""
        reference_R_camera = self._reference_R_camera(t_ns, world_T_body)  # first, as it may forget the past
        chosen = self._chooser.choose(solutions, t_ns, world_T_body)
        best = solutions[chosen]
        self.heading_known = self.tag_was_read = True
        self._before = None
        self._turns = (turns.measured(best.camera_T_pad, best.covariance, reference_R_camera, 0.0),)
        covariance, other, ambiguity = with_doubt(best.camera_T_pad, best.covariance), None, 0.0
        if len(solutions) == 2:
            other = solutions[1 - chosen].camera_T_pad
            covariance = covariance + _mixture(self._chooser.costs, chosen, other, best.camera_T_pad)
            ambiguity = min(math.sqrt(solutions[0].chi2 / max(solutions[1].chi2, 1e-12)), 1.0)
        pose = PadPose(
            best.camera_T_pad,
            covariance,
            "tag",
            ambiguity,
            best.reproj_px,
            other,
            better_fit_rejected=chosen > 0,
        )
        return pose, MIRROR_KEPT if chosen else ""

    def head_by_tag(self, camera_T_pad: Pose, t_ns: int | None, world_T_body: Pose | None) -> None:
        """Take only the heading from a read tag's pose: of a pad seen without perspective it says no more."""
        rotation = self._reference_R_camera(t_ns, world_T_body) @ camera_T_pad.rotation
        self._turns = tuple(
            turn
            if float(turn.reference_R_pad[:, 0] @ rotation[:, 0]) > 0.0
            else replace(turn, reference_R_pad=turn.reference_R_pad @ HALF_TURN.rotation)
            for turn in self._turns
        )
        self.heading_known = self.tag_was_read = True

    def is_surprised(self, solution: Solution, t_ns: int | None, world_T_body: Pose | None) -> bool:
        """Return whether a tag's pose is turned as the pad can hardly have turned: a corner may be misread."""
        reference_R_camera = self._reference_R_camera(t_ns, world_T_body)
        if not self.heading_known or not self._turns:
            return False
        spread = reference_R_camera @ solution.covariance[3:, 3:] @ reference_R_camera.T
        rotation = reference_R_camera @ solution.camera_T_pad.rotation
        return all(
            replace(turn, covariance=turn.covariance + spread).surprise(rotation) > _SURPRISE for turn in self._turns
        )

    def by_print(
        self, image: Image, measurer: PadMeasurer, place: Pose, t_ns: int | None, world_T_body: Pose | None
    ) -> tuple[PadPose, str] | None:
        """Measure the pad by its print where it is expected; None where it is not seen there.

        place: of the expected pad, in the camera; its orientation is used where nothing is known of it yet.
        """
        reference_R_camera = self._reference_R_camera(t_ns, world_T_body)
        known = self._turns or (turns.level(place, reference_R_camera, in_world=self._in_world),)
        found = []
        for turn in known:
            start = Pose(reference_R_camera.T @ turn.reference_R_pad, place.translation)
            seen = measurer.by_print(image, start, turn.known(reference_R_camera), before=self._before)
            if seen is not None:
                found.append((seen, self._cost(turn, seen, reference_R_camera)))
        if len(known) == 1 and found and self._mirror_is_due(measurer, found[0][0], t_ns):
            found += self._mirror(image, measurer, found[0][0], known[0], reference_R_camera)
        return self._believed(image, measurer, found, reference_R_camera)

    def at_box(
        self,
        image: Image,
        measurer: PadMeasurer,
        starts: Sequence[Pose],
        t_ns: int | None,
        world_T_body: Pose | None,
    ) -> tuple[PadPose, str] | None:
        """Measure a pad that was not expected there by its print; None where it is not seen.

        starts: poses it may have, half a turn more is as likely. What is known of its orientation from before still
        counts.
        """
        reference_R_camera = self._reference_R_camera(t_ns, world_T_body)
        found: list[tuple[Registered, float]] = []
        for start in starts:
            pose = self._towards_known(start, reference_R_camera)
            turn = self._nearest(pose, reference_R_camera)
            seen = measurer.by_print(image, pose, is_new=True)
            if seen is not None and all(s.camera_T_pad.angle_to(seen.camera_T_pad) > turns.SAME_RAD for s, _ in found):
                found.append((seen, self._cost(turn, seen, reference_R_camera)))
        return self._believed(image, measurer, found, reference_R_camera)

    def _mirror(
        self, image: Image, measurer: PadMeasurer, seen: Registered, turn: Turn, reference_R_camera: Array
    ) -> list[tuple[Registered, float]]:
        """Return the mirror image of a pose, where the picture shows that as well."""
        other = measurer.by_print(image, mirrored(seen.camera_T_pad), before=seen)
        if other is None or other.camera_T_pad.angle_to(seen.camera_T_pad) < turns.SAME_RAD:
            return []
        if not self._turns:
            return [(other, self._cost(turn, other, reference_R_camera))]
        # it was given up, or could not be told from the other: the past counts no more, that pads are level does
        costs = [
            turns.level(s.camera_T_pad, reference_R_camera, in_world=self._in_world).surprise(
                reference_R_camera @ s.camera_T_pad.rotation
            )
            for s in (seen, other)
        ]
        return [(other, turn.cost + _GIVEN_UP + costs[1] - costs[0])]

    def _mirror_is_due(self, measurer: PadMeasurer, seen: Registered, t_ns: int | None) -> bool:
        """Whether to look for the mirror image: at first, and again every now and then while the pad is small."""
        if not self._turns or t_ns is None or self._mirror_ns is None:
            self._mirror_ns = t_ns
            return True
        due = abs(t_ns - self._mirror_ns) * 1e-9 > _MIRROR_EVERY_S
        if not due or not measurer.is_flat(seen.camera_T_pad, _MIRROR_PX):
            return False
        self._mirror_ns = t_ns
        return True

    def _believed(
        self,
        image: Image,
        measurer: PadMeasurer,
        found: Sequence[tuple[Registered, float]],
        reference_R_camera: Array,
    ) -> tuple[PadPose, str] | None:
        if not found:
            return None
        fits = [seen.chi2 for seen, _ in found]
        costs = [
            cost + min(0.5 * self._worth * (fit - min(fits)), _MOST_FIT)
            for (_, cost), fit in zip(found, fits, strict=True)
        ]
        order = sorted(range(len(found)), key=lambda i: costs[i])
        best, least = found[order[0]][0], costs[order[0]]
        # a near pad moves on by much, and is seen in part: it is begun anew
        self._before = best if measurer.size_px(best.camera_T_pad) < _MIRROR_PX else None
        half_turn = self._settle_heading(image, measurer, best)
        pose = best.camera_T_pad @ half_turn
        kept = [i for i in order if costs[i] - least < turns.DECIDED and self._is_other(i, order, found)]
        kept = kept[:_MOST_TURNS]
        self._turns = tuple(
            turns.measured(
                found[i][0].camera_T_pad @ half_turn, found[i][0].covariance, reference_R_camera, costs[i] - least
            )
            for i in kept
        )
        covariance, other, ambiguity = with_doubt(pose, best.covariance), None, 0.0
        if len(kept) > 1:
            second = found[kept[1]][0]
            other = second.camera_T_pad @ half_turn
            covariance = covariance + _mixture((0.0, costs[kept[1]] - least), 0, other, pose)
            ambiguity = math.exp(-0.5 * min(abs(second.chi2 - best.chi2), 100.0))
        if not self.heading_known:
            normal = pose.rotation[:, 2]
            covariance[3:, 3:] += math.pi**2 / (2.0 + 2.0 * math.cosh(self._heading_odds)) * np.outer(normal, normal)
        rejected = best.chi2 > min(fits)
        result = PadPose(pose, covariance, "target", ambiguity, best.reproj_px, other, better_fit_rejected=rejected)
        said = ["" if self.heading_known else HEADING_OPEN, MIRROR_KEPT if rejected else ""]
        return result, "; ".join(filter(None, said))

    def _is_other(self, i: int, order: Sequence[int], found: Sequence[tuple[Registered, float]]) -> bool:
        """Whether a hypothesis did not come to rest where a likelier one did."""
        before = order[: order.index(i)]
        pose = found[i][0].camera_T_pad
        return all(found[k][0].camera_T_pad.angle_to(pose) > turns.SAME_RAD for k in before)

    def _settle_heading(self, image: Image, measurer: PadMeasurer, best: Registered) -> Pose:
        """Weigh half a turn by this picture; returns it where it became the likelier heading, else no turn."""
        if self.heading_known:
            return Pose.identity()
        odds = measurer.half_turn_odds(image, best)
        if odds is not None:
            self._heading_odds += min(max(_HEADING_WORTH * odds, -_MOST_HEADING), _MOST_HEADING)
        # the first picture says which; later on nothing turns back and forth on no more than noise
        turned = self._heading_odds < (-_HEADING_BACK if self._heading_begun else 0.0)
        self._heading_odds = -self._heading_odds if turned else self._heading_odds
        self._heading_begun = True
        self.heading_known = self._heading_odds > _HEADING_DECIDED
        return HALF_TURN if turned else Pose.identity()

    def _cost(self, turn: Turn, seen: Registered, reference_R_camera: Array) -> float:
        return turn.cost + turn.surprise(reference_R_camera @ seen.camera_T_pad.rotation)

    def _nearest(self, pose: Pose, reference_R_camera: Array) -> Turn:
        """Return the hypothesis nearest to a pose, with nothing known that of a level pad."""
        if not self._turns:
            return turns.level(pose, reference_R_camera, in_world=self._in_world)
        return min(self._turns, key=lambda turn: turn.surprise(reference_R_camera @ pose.rotation))

    def _towards_known(self, pose: Pose, reference_R_camera: Array) -> Pose:
        """Return a pose, half a turn on where that is nearer to the known heading."""
        if not self._turns:
            return pose
        last = Pose(reference_R_camera.T @ self._turns[0].reference_R_pad, pose.translation)
        turned = pose @ HALF_TURN
        return turned if turned.angle_to(last) < pose.angle_to(last) else pose

    def _reference_R_camera(self, t_ns: int | None, world_T_body: Pose | None) -> Array:
        """Return the camera's orientation in the reference frame, the hypotheses brought up to this time."""
        in_world = world_T_body is not None
        elapsed_s = math.inf
        if t_ns is not None and self._last_ns is not None and in_world == self._in_world:
            elapsed_s = abs(t_ns - self._last_ns) * 1e-9
        if elapsed_s > turns.NEW_START_S:
            self._turns = ()
            self._chooser.reset()
        if elapsed_s > 0.0:
            self._worth = _WORTH * min(elapsed_s / _WORTH_S, 1.0)
        elapsed_s = 0.0 if math.isinf(elapsed_s) else elapsed_s
        self._turns = tuple(turn.after(elapsed_s, in_world=in_world) for turn in self._turns)
        self._last_ns, self._in_world = t_ns, in_world
        reference_T_camera = (world_T_body or Pose.identity()) @ self._body_T_camera
        return reference_T_camera.rotation


def _mixture(costs: Sequence[float], chosen: int, other: Pose, best: Pose) -> Array:
    """Return what (6, 6) a second possible pose adds to the covariance of the chosen one: p (1 - p) d d^T."""
    against = costs[1 - chosen] - costs[chosen]
    likely = 1.0 / (1.0 + math.exp(min(max(against, -50.0), 50.0)))
    turn = rotvec_from_rotation(other.rotation @ best.rotation.T)
    difference = np.concatenate([other.translation - best.translation, turn])
    return np.asarray(likely * (1.0 - likely) * np.outer(difference, difference))
