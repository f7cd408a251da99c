"""The pad's numbers against pad.md, its frames, and its TOML."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.errors import InputError, UsageError
from landtool.families import tag_family
from landtool.geometry import Array, Pose
from landtool.pad import BLACK, WHITE, Board, Letter, PadSpec, PadTag, QuietZone, Ring

V1 = PadSpec()
RED, DARK = (215, 25, 28), (20, 20, 20)


def color_at(pad: PadSpec, x_m: float, y_m: float) -> tuple[int, int, int] | None:
    """The colour of the last shape painted over a point of the pad frame."""
    found = None
    for shape in pad.shapes():
        if shape.radius_m:
            inside = math.hypot(x_m - shape.points_m[0, 0], y_m - shape.points_m[0, 1]) < shape.radius_m
        else:
            polygon = shape.points_m.astype(np.float32).reshape(-1, 1, 2)
            inside = cv2.pointPolygonTest(polygon, (x_m, y_m), False) > 0
        found = shape.color if inside else found
    return found


@pytest.mark.parametrize(
    ("x", "y", "color"),
    [
        (0.549, 0.549, WHITE),  # the board, 1.10 D wide
        (0.551, 0.0, None),
        (0.499, 0.0, RED),  # the ring's outer diameter 1.00 D, inner 0.84 D
        (0.0, -0.421, RED),
        (0.0, 0.419, WHITE),
        (0.501, 0.0, WHITE),
        (0.299, 0.21, DARK),  # the left stem: 0.60 D high, from 0.16 D to 0.26 D
        (-0.299, -0.259, DARK),
        (0.301, 0.21, WHITE),
        (0.2, 0.261, WHITE),
        (0.2, 0.159, WHITE),
        (0.2, 0.0, WHITE),  # between the stems, above the crossbar
        (0.049, 0.13, DARK),  # the crossbar, 0.10 D high
        (0.051, 0.13, WHITE),
        (0.099, 0.099, WHITE),  # the quiet zone, 0.20 D wide, over the crossbar
        (0.0, 0.099, WHITE),
        (0.0, 0.101, DARK),
        (0.079, 0.0, BLACK),  # the tag's black border, 0.16 D wide
        (0.081, 0.0, WHITE),
    ],
)
@pytest.mark.parametrize("diameter_m", [1.0, 0.18])
def test_pad_v1_is_painted_as_pad_md_says(x: float, y: float, color: object, diameter_m: float) -> None:
    assert color_at(V1.scaled(diameter_m), x * diameter_m, y * diameter_m) == color


@pytest.mark.parametrize("tag", [PadTag(), PadTag("tagStandard41h12", 17, 0.3, 0.05, -0.02, 90.0)])
def test_the_painted_tag_is_the_family_s_picture_upright(tag: PadTag) -> None:
    pad = PadSpec(tags=(tag,), letter=None)
    family = tag_family(tag.family)
    modules = family.modules(tag.id)
    module = tag.size / family.border_modules
    n = family.total_modules
    # row 0 is nearest the top of the print (+x of the pad), column 0 nearest its left (+y), then turned by yaw
    c, s = math.cos(math.radians(tag.yaw_deg)), math.sin(math.radians(tag.yaw_deg))
    for row in range(n):
        for column in range(n):
            up, left = (n / 2 - row - 0.5) * module, (n / 2 - column - 0.5) * module
            x, y = tag.x + c * up - s * left, tag.y + s * up + c * left
            assert color_at(pad, x, y) == (WHITE if modules[row, column] else BLACK)


def test_tag_frame_is_pad_md_s_turn() -> None:
    half = math.sqrt(0.5)
    pad_T_tag = V1.pad_T_tag(V1.tags[0])
    np.testing.assert_allclose(pad_T_tag.quaternion_wxyz, [half, 0.0, 0.0, -half], atol=1e-12)
    np.testing.assert_array_equal(pad_T_tag.translation, [0.0, 0.0, 0.0])


def test_tag_corners_are_top_left_first_then_clockwise() -> None:
    # x to the top of the print, y to its left
    want = [[0.08, 0.08, 0], [0.08, -0.08, 0], [-0.08, -0.08, 0], [-0.08, 0.08, 0]]
    np.testing.assert_allclose(V1.tag_corners_m(V1.tags[0]), want, atol=1e-12)


def test_an_upright_print_below_and_right_of_the_axis_puts_the_camera_up_and_left() -> None:
    # print upright in a camera that looks straight down on it: image right is -y of the pad, image down is -x
    rotation = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    camera_T_pad = Pose(rotation, np.array([0.3, 0.2, 4.0]))
    x, y, z = camera_T_pad.inverse().translation
    assert x > 0
    assert y > 0
    assert z == pytest.approx(4.0)


def test_a_tag_turned_to_the_left_has_its_top_on_the_left() -> None:
    corners = PadSpec(tags=(PadTag(yaw_deg=90.0),)).tag_corners_m(PadTag(yaw_deg=90.0))
    top: Array = corners[:2].mean(axis=0)
    np.testing.assert_allclose(top, [0.0, 0.08, 0.0], atol=1e-12)


@pytest.mark.parametrize(("pad", "extent"), [(V1, 1.1), (V1.scaled(0.18), 0.198)])
def test_extent_is_the_board(pad: PadSpec, extent: float) -> None:
    assert pad.extent_m == pytest.approx(extent)


def test_outline_is_the_ring_or_the_box_of_the_tags() -> None:
    np.testing.assert_allclose(np.linalg.norm(V1.outline_m, axis=1), 0.5)
    tags_only = PadSpec(ring=None, tags=(PadTag(x=0.2), PadTag(id=6, x=-0.2)))
    np.testing.assert_allclose(np.abs(tags_only.outline_m), [[0.28, 0.08, 0.0]] * 4, atol=1e-12)


PADS = [
    V1,
    V1.scaled(0.18),
    PadSpec(name='odd "name" \\ with\ta tab\nand Ünicode'),
    PadSpec(tags=()),
    PadSpec(board=None, letter=None, quiet_zone=None, tags=()),
    PadSpec(board=None, ring=None, letter=None, quiet_zone=None, tags=(PadTag("tag16h5", 3, 0.1, -0.2, 1e-7, -30.5),)),
    PadSpec(board=Board(1.3, (1, 2, 3)), ring=Ring(0.9, 0.1, (9, 8, 7)), letter=Letter(0.5, 0.4, 0.05, (3, 3, 3))),
    PadSpec(quiet_zone=QuietZone(0.3, (250, 250, 250)), tags=(PadTag(), PadTag(id=6, x=1, y=2))),
]


@pytest.mark.parametrize("pad", PADS)
def test_toml_comes_back(pad: PadSpec, tmp_path: Path) -> None:
    file = tmp_path / "pad.toml"
    file.write_text(pad.to_toml(), encoding="utf-8")
    assert PadSpec.read(file) == pad


def test_what_a_file_leaves_out_is_pad_v1(tmp_path: Path) -> None:
    file = tmp_path / "pad.toml"
    file.write_text("diameter_m = 0.18\n")
    assert PadSpec.read(file) == V1.scaled(0.18)


@pytest.mark.parametrize(
    ("text", "said", "hint"),
    [
        ("diametre_m = 1.0", "unknown key 'diametre_m'", "diameter_m"),
        ("[ring]\ninnner = 0.5", "unknown key 'ring.innner'", "'ring.inner'"),
        ("[[tags]]\nyaw = 3", "unknown key 'tags.yaw'", "'tags.yaw_deg'"),
        ("diameter_m = 0", "not a positive", ""),
        ("diameter_m = nan", "not a positive", ""),
        ("diameter_m = '1'", "must be a number", ""),
        ("diameter_m = true", "must be a number", ""),
        ("name = 5", "name must be a text", ""),
        ("ring = 5", "'ring' must be a table", ""),
        ("ring = true", "'ring' must be a table", ""),
        ("tags = 5", "tags must be a list of tables", ""),
        ("[tags]\nid = 5", "tags must be a list of tables", "[[tags]]"),
        ("[ring]\nouter = 0.5", "inner diameter", ""),
        ("[board]\nside = inf", "finite", ""),
        ("[board]\ncolor = [1, 2]", "three whole numbers", ""),
        ("[board]\ncolor = [true, 2, 3]", "three whole numbers", ""),
        ("[board]\ncolor = [1, 2, 256]", "three whole numbers", ""),
        ("[[tags]]\nid = 5.0", "whole number", ""),
        ("[[tags]]\nid = 100000", "has no tag", "ids go from"),
        ("[[tags]]\nfamily = 'tag36h12'", "unknown tag family", "tag36h11"),
        ("[[tags]]\nfamily = 5", "tags.family must be a text", ""),
        ("[[tags]]\n[[tags]]\n", "same family and id", ""),
        ("ring = false\ntags = []", "needs a tag or a ring", ""),
        ("diameter_m 1", "no valid TOML", ""),
        ("\xff", "no valid TOML", ""),
    ],
)
def test_a_wrong_file_is_named_with_its_key(text: str, said: str, hint: str, tmp_path: Path) -> None:
    file = tmp_path / "pad.toml"
    file.write_text(text, encoding="latin-1")
    with pytest.raises(InputError) as caught:
        PadSpec.read(file)
    assert said in caught.value.reason
    assert hint in caught.value.hint
    assert str(file) in str(caught.value)


def test_a_missing_file_is_a_wrong_request(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"none\.toml"):
        PadSpec.read(tmp_path / "none.toml")
