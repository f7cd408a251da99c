from __future__ import annotations

import numpy as np

from landtool.geometry import Pose
from landtool.landing.main_track import MainTrack
from landtool.types import PadPose, PoseMethod, Track, TrackState


def pose(method: PoseMethod = "tag") -> PadPose:
    return PadPose(Pose(np.eye(3), np.array([0.0, 0.0, 3.0])), np.eye(6), method, 0.0, 0.1)


def track(track_id: int, status: TrackState = "confirmed") -> Track:
    return Track(track_id, status, "body", np.zeros(4), np.eye(4), None, 0.5, np.zeros(2))


def chosen(
    main: MainTrack,
    poses: list[PadPose],
    taken: list[int | None],
    tracks: list[Track],
    looked_for: list[int | None] | None = None,
) -> tuple[PadPose | None, tuple[PadPose, ...]]:
    return main.of(poses, looked_for or [None] * len(poses), taken, tracks)


def test_before_a_track_is_confirmed_the_best_method_leads() -> None:
    box, target, tag = pose("box"), pose("target"), pose("tag")
    tentative = [track(1, "tentative"), track(2, "tentative"), track(3, "tentative")]
    best, others = chosen(MainTrack(), [box, target, tag], [1, 2, 3], tentative)
    assert best is tag
    assert others == (box, target)
    assert chosen(MainTrack(), [box, target], [None, None], [])[0] is target


def test_the_first_confirmed_track_stays_the_main_one() -> None:
    main, first, second = MainTrack(), pose("target"), pose("tag")
    assert chosen(main, [second, first], [2, 1], [track(1), track(2)])[0] is first
    assert main.track_id == 1
    # even where the other is measured alone, and while it coasts
    assert chosen(main, [second], [2], [track(1, "coasting"), track(2)]) == (None, (second,))
    assert main.track_id == 1
    assert chosen(main, [second, first], [2, 1], [track(1), track(2)]) == (first, (second,))


def test_a_tentative_track_does_not_lead_while_a_confirmed_one_lives() -> None:
    main, old, new = MainTrack(), pose("target"), pose("tag")
    assert chosen(main, [new, old], [2, 1], [track(2, "tentative"), track(1)])[0] is old
    assert main.track_id == 1


def test_when_its_track_ends_the_oldest_of_the_others_takes_over() -> None:
    main, second, third = MainTrack(), pose("box"), pose("tag")
    chosen(main, [pose()], [1], [track(1)])
    best, others = chosen(main, [third, second], [3, 2], [track(2), track(3)])
    assert (best, others, main.track_id) == (second, (third,), 2)


def test_when_no_track_is_left_it_is_forgotten() -> None:
    main, only = MainTrack(), pose()
    chosen(main, [only], [1], [track(1)])
    assert chosen(main, [], [], []) == (None, ())
    assert main.track_id is None
    assert chosen(main, [only], [None], []) == (only, ())


def test_a_pose_the_filter_refused_is_still_that_of_the_main_pad() -> None:
    main, seen = MainTrack(), pose()
    chosen(main, [seen], [1], [track(1)])
    # where the track expected it, but out of its gate: a new track began with it
    assert chosen(main, [seen], [2], [track(1), track(2, "tentative")], [1]) == (seen, ())
    assert main.track_id == 1
