"""Whole pictures: the same from the same number, and true to what is said of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.pad import PadSpec
from landtool.synth.domain import Domain
from landtool.synth.make_sample import make_sample
from landtool.synth.sample import Sample
from landtool.tags.pose import pad_corners, pad_solutions
from landtool.tags.reader import ReaderConfig, TagReader
from tests.scenes import CLEAN_DOMAIN

PAD = PadSpec()
SIZE = (640, 480)
SMALL = (208, 156)
READABLE_PX = 14.0  # side of a tag


def clean(count: int) -> Iterator[Sample]:
    """Yield pictures with the whole tag in them, large enough to be read."""
    index = found = 0
    while found < count:
        sample = make_sample(CLEAN_DOMAIN, PAD, SIZE, 3, index)
        index += 1
        corners = sample.truth.tag_corners_px
        if corners is None or not ((corners > 4.0).all() and (corners < np.array(SIZE) - 5.0).all()):
            continue
        if np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).min() > READABLE_PX:
            found += 1
            yield sample


def test_the_same_number_gives_the_same_bytes() -> None:
    first = make_sample(Domain(), PAD, SMALL, 5, 17)
    make_sample(Domain(), PAD, SMALL, 5, 18)
    assert make_sample(Domain(), PAD, SMALL, 5, 17).jpeg == first.jpeg
    assert make_sample(Domain(), PAD, SMALL, 6, 17).jpeg != first.jpeg


def test_labels_say_what_is_there() -> None:
    present = 0
    for index in range(40):
        truth = make_sample(Domain(), PAD, SMALL, 9, index).truth
        if not truth.present:
            assert truth.box_px is None
            assert truth.visible_fraction == 0.0
            continue
        present += 1
        assert truth.box_px is not None
        assert truth.camera_T_pad is not None
        x0, y0, x1, y1 = truth.box_px
        assert -0.5 <= x0 < x1 <= SMALL[0] - 0.5
        assert -0.5 <= y0 < y1 <= SMALL[1] - 0.5
        assert 0.0 < truth.visible_fraction <= 1.0
        pad_T_camera = truth.camera_T_pad.inverse()
        assert pad_T_camera.translation[2] == pytest.approx(truth.height_m)
    assert 25 <= present <= 39


def test_everything_can_be_switched_off() -> None:
    nothing = replace(
        CLEAN_DOMAIN, signs_with_pad=0.0, signs_without_pad=0.0, on_vehicle=0.0, on_box=0.0, on_deck=0.0, things=0.0,
        distortion=0.0, tilt_deg=(0.0, 0.0), hfov_deg=(70.0, 70.0), overcast=0.0, height_m=(2.0, 2.0),
    )  # fmt: skip
    truth = make_sample(nothing, PAD, SMALL, 1, 0).truth
    assert truth.carrier == "ground"
    assert truth.signs == ()
    assert truth.tilt_rad == 0.0
    assert truth.height_m == pytest.approx(2.0)
    assert not any(truth.camera.distortion)
    assert truth.beta_per_m == truth.hidden == 0.0


def test_what_was_done_to_a_picture_is_said() -> None:
    always = replace(
        CLEAN_DOMAIN, curl=1.0, on_vehicle=0.0, on_box=0.0, on_deck=0.0, motion_blur=1.0, motion_blur_px=(3.0, 3.0),
        occlusion=1.0, overcast=1.0, small_print=1.0, small_print_scale=(4.0, 4.0), least_visible=0.5,
    )  # fmt: skip
    said = dict(make_sample(always, PAD, SMALL, 2, 0).truth.applied)
    assert said["curled"] == said["occluder"] == 1.0
    assert said["dirty"] == 0.0
    assert said["sky"] == "overcast"
    assert said["scale"] == pytest.approx(4.0)
    assert said["motion_px"] == pytest.approx(3.0)
    plain = dict(make_sample(CLEAN_DOMAIN, PAD, SMALL, 2, 0).truth.applied)
    assert plain["curled"] == plain["motion_px"] == plain["occluder"] == 0.0


def test_a_domain_without_a_picture_of_the_pad_is_refused_and_not_searched_for_ever() -> None:
    with pytest.raises(UsageError, match="from heights of 500 to 900 m hardly any picture shows"):
        make_sample(replace(CLEAN_DOMAIN, height_m=(500.0, 900.0)), PAD, SMALL, 1, 0)


@pytest.mark.parametrize("count", [30, pytest.param(200, marks=pytest.mark.full)])
def test_tag_corners_are_where_the_library_finds_them(count: int) -> None:
    reader = TagReader(ReaderConfig.of_pad(PAD))
    errors, turns, ranges = [], [], []
    for sample in clean(count):
        truth = sample.truth
        assert truth.tag_corners_px is not None
        assert truth.camera_T_pad is not None
        tags = [t for t in reader.read_frame(sample.image) if np.abs(t.corners_px - truth.tag_corners_px).max() < 5.0]
        if not tags:
            continue
        errors.append(tags[0].corners_px - truth.tag_corners_px)
        corners = pad_corners(tags, truth.camera, PAD)
        assert corners is not None
        exact = truth.camera_T_pad
        one = min(pad_solutions(corners), key=lambda s: s.camera_T_pad.angle_to(exact))
        turns.append(one.camera_T_pad.angle_to(exact))
        ranges.append(np.linalg.norm(one.camera_T_pad.translation - exact.translation) / truth.distance_m)
    assert len(errors) >= 0.95 * count
    off = np.array(errors)
    print(f"corners: median {np.median(np.abs(off)):.4f} px, mean {off.mean(axis=(0, 1))} px of {len(off)} pictures")
    assert np.median(np.linalg.norm(off, axis=2)) < 0.05
    assert np.abs(off.mean(axis=(0, 1))).max() < 0.02
    # outwards: neither larger nor smaller than the truth says
    middle = off - off.mean(axis=1, keepdims=True)
    assert abs(float(middle.mean())) < 0.02
    assert np.median(ranges) < 0.002
    assert np.median(turns) < np.radians(0.5)


@pytest.mark.parametrize(
    "changes",
    [
        {"height_m": (5.0, 2.0)},
        {"tilt_deg": (0.0, 89.0)},
        {"absent": 1.2},
        {"least_visible": 0.0},
        {"on_vehicle": 0.9, "on_box": 0.3},
        {"visibility_m": (float("nan"), 10.0)},
        {"things": -1.0},
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        replace(Domain(), **changes)  # type: ignore[arg-type]


def test_a_picture_in_fog_has_a_clear_twin() -> None:
    foggy = replace(CLEAN_DOMAIN, fog=1.0, visibility_m=(15.0, 30.0), height_m=(3.0, 5.0))
    plain, both = (make_sample(foggy, PAD, SMALL, 4, 2, clear=clear) for clear in (False, True))
    assert plain.clear is None
    assert both.jpeg == plain.jpeg
    assert both.clear is not None
    twin = cv2.imdecode(np.frombuffer(both.clear, np.uint8), cv2.IMREAD_COLOR)
    assert twin is not None
    assert twin.shape == both.image.shape
    # the same scene, with more contrast
    assert np.corrcoef(twin.ravel(), both.image.ravel())[0, 1] > 0.9
    assert twin.std() > 1.2 * both.image.std()
    assert make_sample(replace(foggy, fog=0.0), PAD, SMALL, 4, 2, clear=True).clear is None
