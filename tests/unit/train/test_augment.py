"""What is done to a picture is done to its boxes: a rectangle painted where a label is stays where the label goes."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from landtool.train.augment import clipped, degraded, four, mirrored, part, recoloured, whole, without_largest
from landtool.train.samples import Example
from landtool.train.settings import TrainSettings

COLORS = ((0, 0, 255), (0, 255, 0), (255, 0, 0), (0, 255, 255))  # BGR
BOXES = ((100, 60, 180, 140), (20, 150, 60, 170), (3, 3, 300, 235), (250, 0, 320, 50))
SETTINGS = TrainSettings(pyramid=False)  # every target is learnt, however large
SIZE = (128, 96)
Change = Callable[[Example, np.random.Generator], Example]
CHANGES: dict[str, Change] = {
    "part": lambda e, rng: part(e, *SIZE, SETTINGS, rng),
    "whole": lambda e, rng: whole(e, *SIZE, SETTINGS, rng),
    "mirrored": lambda e, rng: mirrored(e, 0.5, rng),
}


def painted(place: int) -> Example:
    """A grey picture of 320 x 240 with a rectangle in a colour of its own where its label is."""
    x0, y0, x1, y1 = BOXES[place]
    image = np.full((240, 320, 3), 60, np.uint8)
    image[y0:y1, x0:x1] = COLORS[place]
    return Example.of(image, np.array([[x0, y0, x1, y1]], float), [place])


def edges(example: Example, place: int) -> np.ndarray | None:
    """Where the rectangle is seen: the edges of the pixels that are more of its colour than not."""
    color = np.array(COLORS[place])
    near = cv2.inRange(example.image, color - 110, color + 110) > 0
    rows, columns = np.nonzero(near.any(axis=1))[0], np.nonzero(near.any(axis=0))[0]
    return np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]) if len(rows) else None


def check(example: Example) -> int:
    """Compare every label with what is seen, within a pixel; return how many there are."""
    for box, label in zip(example.boxes, example.labels, strict=True):
        seen = edges(example, int(label))
        if seen is None:
            assert (box[2:] - box[:2]).min() <= 1.5
        else:
            assert np.abs(seen - box).max() <= 1.0
    for place in set(range(4)) - set(example.labels.tolist()):
        seen = edges(example, place)
        assert seen is None or (seen[2:] - seen[:2]).min() <= 1
    return len(example.boxes)


@pytest.mark.parametrize("name", CHANGES)
def test_labels_stay_on_their_targets(name: str) -> None:
    shown = 0
    for seed in range(40):
        changed = CHANGES[name](painted(seed % 4), np.random.default_rng(seed))
        assert changed.image.shape == ((240, 320, 3) if name == "mirrored" else (96, 128, 3))
        shown += check(changed)
    assert shown >= 25


def test_labels_stay_on_their_targets_in_four_pictures_in_one() -> None:
    shown = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        joined = four([part(painted(place), *SIZE, SETTINGS, rng) for place in range(4)], *SIZE, rng)
        assert joined.image.shape == (96, 128, 3)
        shown += check(joined)
    assert shown >= 45


@pytest.mark.parametrize("name", CHANGES)
def test_the_same_random_numbers_make_the_same_picture(name: str) -> None:
    first, again = (CHANGES[name](painted(0), np.random.default_rng(4)) for _ in range(2))
    assert (first.image == again.image).all()
    assert (first.boxes == again.boxes).all()
    others = [CHANGES[name](painted(0), np.random.default_rng(seed)).image for seed in range(5, 9)]
    assert any((first.image != other).any() for other in others)


def test_parts_show_a_target_more_often_than_not() -> None:
    shown = [part(painted(1), *SIZE, SETTINGS, np.random.default_rng(seed)) for seed in range(60)]
    complete = [len(e.boxes) and not e.ignored.any() for e in shown]
    assert 30 <= sum(map(bool, complete)) <= 58


def test_a_picture_without_targets_is_a_background() -> None:
    empty = Example.of(np.full((240, 320, 3), 60, np.uint8), np.empty((0, 4)), [])
    for name, change in CHANGES.items():
        changed = change(empty, np.random.default_rng(0))
        assert changed.boxes.shape == (0, 4), name
        assert changed.labels.dtype == np.int64
        assert changed.ignored.dtype == np.bool_


def test_a_target_is_learnt_only_if_enough_of_it_is_left() -> None:
    boxes = np.array([[0, 0, 40, 40], [0, 20, 40, 60], [90, 0, 130, 20], [50, 50, 56, 56], [200, 200, 240, 240.0]])
    example = Example.of(np.zeros((300, 300, 3), np.uint8), boxes, [0, 1, 2, 3, 4])
    cut = clipped(example, (10.0, 30.0, 100.0, 100.0))
    # the first keeps 30 x 10 of 40 x 40; the third nothing; the fourth is small
    assert cut.boxes.tolist() == [[10, 30, 40, 40], [10, 30, 40, 60], [50, 50, 56, 56]]
    assert cut.labels.tolist() == [0, 1, 3]
    assert cut.ignored.tolist() == [True, False, True]
    again = clipped(cut, (10.0, 30.0, 100.0, 100.0))
    assert again.ignored.tolist() == [True, False, True]  # what was ignored stays so


def test_mirroring_twice_is_nothing() -> None:
    example = painted(0)
    back = mirrored(mirrored(example, 1.0, np.random.default_rng(0)), 1.0, np.random.default_rng(0))
    assert (back.image == example.image).all()
    assert (back.boxes == example.boxes).all()
    still = mirrored(example, 0.0, np.random.default_rng(0))
    assert (still.image == example.image).all()


def test_no_change_of_colour_is_nearly_none() -> None:
    rng = np.random.default_rng(1)
    image = rng.integers(0, 256, (60, 80, 3), np.uint8)
    still = TrainSettings(hue=0.0, saturation=1.0, exposure=1.0)
    # 8-bit HSV has 180 hues
    assert np.abs(recoloured(image, still, rng).astype(int) - image).max() <= 6
    changed = recoloured(image, SETTINGS, rng)
    assert np.abs(changed.astype(int) - image).mean() > 5
    assert changed.dtype == np.uint8


def test_exposure_goes_both_ways() -> None:
    grey = np.full((4, 4, 3), 100, np.uint8)
    settings = TrainSettings(hue=0.0, saturation=1.0, exposure=1.5)
    levels = [int(recoloured(grey, settings, np.random.default_rng(seed))[0, 0, 0]) for seed in range(200)]
    assert 66 <= min(levels) < 72
    assert 142 < max(levels) <= 150


def test_degraded_pictures_keep_their_shape_and_can_be_made_again() -> None:
    image = painted(0).image
    before = image.copy()
    different = 0
    for seed in range(20):
        first, again = (degraded(image, np.random.default_rng(seed)) for _ in range(2))
        assert first.shape == image.shape
        assert first.dtype == np.uint8
        assert (first == again).all()
        different += bool((first != image).any())
    assert different >= 15
    assert (image == before).all()


def test_the_largest_targets_are_left_to_the_look_at_half_size() -> None:
    sides = np.array([100.0, 330.0, 331.0, 400.0, 401.0])
    boxes = np.column_stack([np.zeros((5, 2)), sides, np.full(5, 50.0)])
    example = Example.of(np.zeros((480, 640, 3), np.uint8), boxes, [0] * 5)
    left = without_largest(example)
    assert left.boxes[:, 2].tolist() == [100.0, 330.0, 331.0, 400.0]
    assert left.ignored.tolist() == [False, False, True, True]
