"""The finder where something is wrong with what it is shown: look-alikes, borders, several pads, clocks, sizes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from landtool.camera import Camera
from landtool.detect.stage import DetectStage
from landtool.geometry import Pose
from landtool.io.poses import STRAIGHT_DOWN
from landtool.landing.follower import PadFollower
from landtool.landing.measure import PRINT_PX, PadMeasurer
from landtool.pad import PadSpec, PadTag
from landtool.synth.render import encode, render_pad
from landtool.types import Frame, FrameResult, Image, LostFrame
from tests.method import Told, followed, pad_finder, ring_box
from tests.scenes import CAMERA, PAD, photograph, view

FRAME_NS = 33_333_333
GROUND = np.full((480, 640, 3), 110, np.uint8)
# strokes of other letters, on the pad, metres
LETTERS = {
    "T": (
        ((0.3, 0.26), (0.3, -0.26), (0.2, -0.26), (0.2, 0.26)),
        ((0.3, 0.05), (0.3, -0.05), (-0.3, -0.05), (-0.3, 0.05)),
    ),
    "X": (
        ((0.3, 0.26), (0.3, 0.16), (-0.3, -0.26), (-0.3, -0.16)),
        ((0.3, -0.26), (0.3, -0.16), (-0.3, 0.26), (-0.3, 0.16)),
    ),
    "nothing": (),
}


def frames(images: Sequence[Image]) -> list[Frame]:
    return [Frame(index, index * FRAME_NS, image) for index, image in enumerate(images)]


def shown(camera_T_pads: Sequence[Pose], rng: np.random.Generator, pad: PadSpec = PAD) -> Image:
    """A picture of several pads, the later ones over the earlier."""
    scene = np.full((CAMERA.height, CAMERA.width, 3), 0.2, np.float32)
    for camera_T_pad in camera_T_pads:
        scene = render_pad(CAMERA, camera_T_pad, pad, background=scene)
    return encode(0.8 * scene, blur_sigma_px=0.6, noise_sigma=4.0, rng=rng)


def with_letter(camera_T_pad: Pose, letter: str, rng: np.random.Generator) -> Image:
    bare = replace(PAD, letter=None, quiet_zone=None, tags=())
    scene = render_pad(CAMERA, camera_T_pad, bare, background=np.full((480, 640, 3), 0.2, np.float32))
    for stroke in LETTERS[letter]:
        corners = CAMERA.project(camera_T_pad.apply(np.column_stack([np.array(stroke), np.zeros(4)])))
        cv2.fillPoly(scene, [np.round(16 * corners).astype(np.int32)], (0.01,) * 3, cv2.LINE_AA, 4)
    return encode(0.8 * scene, blur_sigma_px=0.6, noise_sigma=4.0, rng=rng)


def told(result: FrameResult) -> str:
    """What a result says, after a look at every number in it."""
    for pose in filter(None, (result.pose, *result.other_poses)):
        numbers = [*pose.camera_T_pad.rotation.flat, *pose.camera_T_pad.translation, *pose.covariance.flat]
        assert np.isfinite([*numbers, pose.ambiguity, pose.reproj_px]).all()
        assert np.linalg.eigvalsh(pose.covariance).min() > 0.0
    for track in result.tracks:
        assert np.isfinite([*track.state, *track.covariance.flat, *track.predicted_xy_m, track.nis or 0.0]).all()
    return result.reason


def off(result: FrameResult, truth: Pose) -> tuple[float, float]:
    """How far a pose is off, in shares of the distance and degrees."""
    assert result.pose is not None
    found = result.pose.camera_T_pad
    apart = np.linalg.norm(found.translation - truth.translation) / np.linalg.norm(truth.translation)
    return float(apart), math.degrees(found.angle_to(truth))


@pytest.mark.parametrize("letter", list(LETTERS))
@pytest.mark.parametrize("distance_m", [12.0, 6.0, 3.0])
def test_another_letter_in_the_ring_is_no_pad(letter: str, distance_m: float) -> None:
    pose = view(distance_m, 5.0, 0.3, 0.4, (0.05, 0.02))
    image = with_letter(pose, letter, np.random.default_rng(1))
    results = list(followed(frames([image] * 4), pad_finder(detector=DetectStage(Told(ring_box(pose))))))
    assert [(r.pose, r.tracks) for r in results] == [(None, ())] * 4
    assert all("a box shows" in told(r) for r in results)


@pytest.mark.parametrize("tags", [(PadTag(id=7),), ()], ids=["another tag", "no tag"])
def test_a_print_without_the_pads_tag_is_given_up(tags: tuple[PadTag, ...]) -> None:
    other = replace(PAD, tags=tags)
    rng = np.random.default_rng(2)
    near = view(3.0, 5.0, 0.3, 0.4)
    image = photograph(near, rng, pad=other)
    seen = list(followed(frames([image] * 3), pad_finder(detector=DetectStage(Told(ring_box(near))))))
    assert [(r.pose, told(r)) for r in seen] == [(None, "a print like the pad's, but without its tag")] * 3


def test_a_track_without_the_pads_tag_ends() -> None:
    """From afar nobody can tell; near it is believed for some frames more."""
    other, rng = replace(PAD, tags=(PadTag(id=7),)), np.random.default_rng(2)
    truths = [view(9.0 - 0.4 * i, 5.0, 0.3, 0.4) for i in range(15)]
    pictures = [photograph(truth, rng, pad=other) for truth in truths]
    shots = [Frame(i, i * 3 * FRAME_NS, image) for i, image in enumerate(pictures + pictures[-1:] * 48)]
    network = Told(ring_box(truths[0]))
    results = list(followed(shots, pad_finder(detector=DetectStage(network))))
    assert results[5].pose is not None
    assert results[5].tracks[0].status == "confirmed"
    assert [(r.pose, r.tracks) for r in results[-2:]] == [(None, ())] * 2
    assert any("without its tag" in told(result) for result in results)


def test_a_tag_that_was_read_once_may_be_covered() -> None:
    rng = np.random.default_rng(3)
    pose = view(3.0, 5.0, 0.3, 0.4)
    covered = photograph(pose, rng, pad=replace(PAD, tags=()))
    results = list(followed(frames([photograph(pose, rng)] * 3 + [covered] * 40)))
    assert {r.pose.method for r in results[:3] if r.pose} == {"tag"}
    assert [r.pose.method for r in results[3:] if r.pose] == ["target"] * 40
    assert results[-1].tracks[0].status == "confirmed"


@pytest.mark.parametrize("distance_m", [15.0, 5.0, 1.0])
def test_a_pad_that_comes_in_over_the_border(distance_m: float) -> None:
    """No pose from half a ring: where it is begun it is right, and the track is one."""
    rng = np.random.default_rng(4)
    left = -319.5 / 554.0
    truths = [view(distance_m, 4.0, 0.3, 0.4, (left + (0.04 * i - 0.6) / distance_m, 0.05)) for i in range(36)]
    network = Told()
    results = []
    finder = pad_finder(detector=DetectStage(network))

    def pictures() -> list[Frame]:
        return frames([photograph(truth, rng) for truth in truths])

    def played() -> Iterator[Frame]:
        for frame, truth in zip(pictures(), truths, strict=True):
            x0, y0, x1, y1 = (getattr(ring_box(truth), n) for n in ("x_min_px", "y_min_px", "x_max_px", "y_max_px"))
            box = replace(ring_box(truth), x_min_px=max(x0, -0.5), y_min_px=max(y0, -0.5), y_max_px=min(y1, 479.5))
            network.boxes = (box,) if x1 - max(x0, -0.5) > 0.3 * (x1 - x0) else ()
            yield frame

    results = list(followed(played(), finder))
    assert all(told(r) or r.pose for r in results)
    posed = [r for r in results if r.pose is not None]
    assert len(posed) >= 12
    assert posed[-1].index == 35
    assert max(off(r, truths[r.index])[0] for r in posed) < 0.03
    assert {track.track_id for r in results for track in r.tracks} == {1}
    assert any("cut by the picture's border" in r.reason for r in results)


def test_two_pads_have_two_tracks_that_never_swap() -> None:
    rng = np.random.default_rng(5)
    first = [view(9.0 - 0.1 * i, 4.0, 0.3, 0.4, (-0.1 + 0.01 * math.sin(i / 4), 0.0)) for i in range(30)]
    second = [view(9.0 - 0.1 * i, 4.0, 0.3, 2.4, (0.12 + 0.01 * math.sin(i / 4), 0.03)) for i in range(30)]
    network = Told()

    def played() -> Iterator[Frame]:
        for i, pair in enumerate(zip(first, second, strict=True)):
            network.boxes = tuple(ring_box(pose) for pose in pair)
            yield Frame(i, i * FRAME_NS, shown(pair, rng))

    results = list(followed(played(), pad_finder(detector=DetectStage(network))))
    own, other = (first, second) if off(results[3], first[3])[0] < off(results[3], second[3])[0] else (second, first)
    for result in results[3:]:
        told(result)
        assert off(result, own[result.index])[0] < 0.005
        assert len(result.other_poses) == 1
        aside = replace(result, pose=result.other_poses[0])
        assert off(aside, other[result.index])[0] < 0.005
        assert [track.track_id for track in result.tracks] == [1, 2]
    places = np.array([[track.state[:2] for track in result.tracks] for result in results[3:]])
    assert (places[:, 0, 1] > places[:, 1, 1]).all() or (places[:, 0, 1] < places[:, 1, 1]).all()


def test_a_tilt_seen_by_a_long_lens_does_not_flip() -> None:
    """Twice the pixels are half the perspective: the tag's edges alone took the mirror image, 10 degrees off."""
    camera = Camera(1920, 1080, 1662.0, 1662.0, 959.5, 539.5)
    rng = np.random.default_rng(1)
    truths = [view(20.0 - 0.5 * i, 5.0, 0.3, 0.4, (0.05, 0.02)) for i in range(10)]
    shots = frames([photograph(truth, rng, camera=camera) for truth in truths])
    results = list(followed(shots, pad_finder(camera=camera)))
    assert max(off(r, truth)[1] for r, truth in zip(results, truths, strict=True)) < 2.0


def test_how_flat_a_pad_looks() -> None:
    measurer = PadMeasurer(CAMERA, PAD, "srgb")
    longer = PadMeasurer(Camera(1920, 1080, 1662.0, 1662.0, 959.5, 539.5), PAD, "srgb")
    near, far = view(5.0, 0.0, 0.0, 0.0), view(7.0, 0.0, 0.0, 0.0)
    assert [measurer.is_flat(pose, PRINT_PX) for pose in (near, far)] == [False, True]
    assert longer.size_px(view(15.0, 0.0, 0.0, 0.0)) > PRINT_PX
    assert longer.is_flat(view(15.0, 0.0, 0.0, 0.0), PRINT_PX)


def test_a_tag_turns_the_heading_round_and_leaves_the_tilt() -> None:
    rng = np.random.default_rng(6)
    truth, follower = view(8.0, 6.0, 1.0, 0.4), PadFollower(STRAIGHT_DOWN)
    measurer, image = PadMeasurer(CAMERA, PAD, "srgb"), photograph(truth, rng)
    turned = truth @ Pose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
    assert follower.by_print(image, measurer, turned, 0, None) is not None
    follower.head_by_tag(truth, 0, None)
    seen = follower.by_print(image, measurer, truth, FRAME_NS, None)
    assert seen is not None
    assert seen[0].camera_T_pad.angle_to(truth) < math.radians(3.0)
    assert follower.heading_known


@pytest.mark.parametrize("level", [0, 110, 255])
def test_a_plain_picture_shows_nothing(level: int) -> None:
    results = list(followed(frames([np.full((480, 640, 3), level, np.uint8)] * 3)))
    assert [(r.pose, r.tracks, told(r)) for r in results] == [(None, (), "nothing of the pad found")] * 3


CLOCKS = {
    "repeated": [0, 1, 1, 1, 2, 3, 4, 5],
    "one back": [0, 1, 2, 3, 2, 5, 6, 7],
    "stands": [0] * 8,
    "starts anew": [200, 201, 202, 203, 0, 1, 2, 3],
    "leaps": [10**5 * i for i in range(8)],
    "negative": [i - 10**9 for i in range(8)],
}


@pytest.mark.parametrize("ticks", CLOCKS.values(), ids=list(CLOCKS))
def test_any_clock(ticks: list[int]) -> None:
    rng = np.random.default_rng(7)
    truths = [view(3.0 - 0.02 * i, 5.0, 0.3, 0.4) for i in range(8)]
    shots = [
        Frame(i, tick * FRAME_NS, photograph(t, rng)) for i, (tick, t) in enumerate(zip(ticks, truths, strict=True))
    ]
    results = list(followed(shots))
    assert all(off(r, truth)[0] < 0.005 for r, truth in zip(results, truths, strict=True))
    assert all(r.tracks for r in results)
    said = "; ".join(filter(None, map(told, results)))
    assert ("time went back" in said) == (ticks[0] == 200)


def test_no_clock_and_one_frame() -> None:
    image = photograph(view(3.0, 5.0, 0.3, 0.4), np.random.default_rng(8))
    (unclocked,) = followed([Frame(0, None, image)])
    assert unclocked.pose is not None
    assert (unclocked.tracks, told(unclocked)) == ((), "no clock, so no track")
    (one,) = followed([Frame(0, 0, image)])
    assert one.pose is not None
    assert (one.tracks[0].status, told(one)) == ("tentative", "")


def test_lost_frames_and_pictures_of_another_size() -> None:
    rng = np.random.default_rng(9)
    image = photograph(view(3.0, 5.0, 0.3, 0.4), rng)
    small, tiny = np.asarray(cv2.resize(image, (320, 240)), np.uint8), image[:3, :3]
    shots: list[Frame | LostFrame] = [*frames([image] * 4)]
    shots += [LostFrame(4, 4 * FRAME_NS, "lost"), Frame(5, 5 * FRAME_NS, small), Frame(6, 6 * FRAME_NS, tiny)]
    shots += [LostFrame(7, None, "lost"), Frame(8, 8 * FRAME_NS, image)]
    results = list(followed(shots))
    assert [r.pose is not None for r in results] == [True] * 4 + [False] * 4 + [True]
    assert results[4].status == "damaged"
    assert told(results[5]) == "picture of 320x240, calibration for 640x480"
    assert told(results[6]) == "the picture is too small to show a tag"
    assert [track.track_id for track in results[8].tracks] == [1]


def test_a_pad_that_leaves_and_comes_back() -> None:
    """Within the time a track coasts it is the same, later another; no pose of what is not there."""
    rng = np.random.default_rng(10)
    image = photograph(view(3.0, 5.0, 0.3, 0.4), rng)
    for gap, number in ((20, 1), (70, 2)):
        results = list(followed(frames([image] * 6 + [GROUND] * gap + [image] * 9)))
        assert all(r.pose is None and told(r) == "nothing of the pad found" for r in results[6:-9])
        assert [track.track_id for track in results[-1].tracks] == [number]
        assert all(r.pose is not None for r in results[-3:])


@pytest.mark.parametrize("pad", [replace(PAD, ring=None), replace(PAD, letter=None), replace(PAD, board=None)],
                         ids=["no ring", "no letter", "no board"])  # fmt: skip
def test_a_pad_that_lacks_a_part_is_measured_by_its_tag(pad: PadSpec) -> None:
    rng = np.random.default_rng(11)
    truths = [view(3.0 - 0.02 * i, 5.0, 0.3, 0.4) for i in range(5)]
    shots = frames([photograph(truth, rng, pad=pad) for truth in truths])
    results = list(followed(shots, pad_finder(pad)))
    assert all(off(r, truth)[0] < 0.01 for r, truth in zip(results, truths, strict=True))
    assert {r.pose.method for r in results if r.pose} == {"tag"}
    assert not any(map(told, results))
