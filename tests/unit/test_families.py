"""The tag pictures against pad.md's and OpenCV's own."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.families import FAMILIES, canonical_name, tag_family

PAD_TAG = """\
..........
.########.
.#....###.
.#..###.#.
.#..#..##.
.#.#.#..#.
.###...##.
.#.#..###.
.########.
..........
"""
OPENCV = {
    "tag36h11": cv2.aruco.DICT_APRILTAG_36h11,
    "tag25h9": cv2.aruco.DICT_APRILTAG_25h9,
    "tag16h5": cv2.aruco.DICT_APRILTAG_16h5,
}


def test_tag_5_is_the_picture_of_the_conventions() -> None:
    rows = ["".join(".#"[not white] for white in row) for row in tag_family("tag36h11").modules(5)]
    assert "\n".join(rows) + "\n" == PAD_TAG


@pytest.mark.parametrize("name", OPENCV)
def test_opencv_draws_every_tag_upside_down(name: str) -> None:
    family = tag_family(name)
    dictionary = cv2.aruco.getPredefinedDictionary(OPENCV[name])
    for tag_id in range(0, len(family.codes), 1 + len(family.codes) // 30):
        drawn = cv2.aruco.generateImageMarker(dictionary, tag_id, family.border_modules) > 0
        inside = family.modules(tag_id)[1:-1, 1:-1]
        np.testing.assert_array_equal(inside, np.rot90(drawn, 2))


@pytest.mark.parametrize("name", FAMILIES)
def test_layout_and_border(name: str) -> None:
    family = tag_family(name)
    image = family.modules(0)
    m, n = family.margin_modules, family.total_modules
    assert image.shape == (n, n)
    assert n == family.border_modules + 2 * m
    edge = np.concatenate([image[m, m : n - m], image[n - m - 1, m : n - m], image[m : n - m, m]])
    outside = np.concatenate([image[m - 1, m - 1 : n - m + 1], image[m - 1 : n - m + 1, m - 1]])
    assert (edge == family.reversed_border).all()
    if not family.reversed_border:
        assert outside.all()  # a black border stands on white


@pytest.mark.parametrize("name", FAMILIES)
def test_every_picture_differs_from_every_other_in_every_turn(name: str) -> None:
    family = tag_family(name)
    step = 1 + len(family.codes) // 40
    pictures = [np.rot90(family.modules(i), k).tobytes() for i in range(0, len(family.codes), step) for k in range(4)]
    assert len(set(pictures)) == len(pictures)


@pytest.mark.parametrize("name", ["tag36h11", "36h11", "DICT_APRILTAG_36h11", "TAG36H11", " 36H11 "])
def test_spellings(name: str) -> None:
    assert canonical_name(name) == "tag36h11"
    assert tag_family(name).name == "tag36h11"


@pytest.mark.parametrize("family", FAMILIES)
def test_a_canonical_name_stays(family: str) -> None:
    assert canonical_name(family) == family


def test_an_unknown_family_names_the_nearest() -> None:
    with pytest.raises(UsageError) as caught:
        canonical_name("tag36h12")
    assert "nearest is tag36h11" in caught.value.hint


@pytest.mark.parametrize("tag_id", [-1, 30])
def test_an_id_outside_the_family_is_refused(tag_id: int) -> None:
    with pytest.raises(UsageError, match="0 to 29"):
        tag_family("tag16h5").modules(tag_id)
