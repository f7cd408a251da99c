from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from landtool.families import FAMILIES, tag_family
from landtool.geometry import Array
from landtool.pad import PadSpec, PadTag
from landtool.synth.truth import tag_corners_px
from landtool.tags import reader as reader_module
from landtool.tags.reader import ReaderConfig, Region, TagReader, module_px
from landtool.types import Image, TagObservation
from tests.scenes import CAMERA, PAD, photograph, view
from tests.unit.tags.clutter import clutter, photographs
from tests.unit.tags.small import Shot, shoot

READER = TagReader(ReaderConfig.of_pad(PAD))


def drawn(family: str, tag_id: int, scale: int = 9, flipped: Sequence[tuple[int, int]] = ()) -> tuple[Image, Array]:
    """Draw a tag from its modules alone, sharp, with a white rim; return it and its corners (4, 2)."""
    layout = tag_family(family)
    modules = layout.modules(tag_id).astype(np.uint8)
    for row, column in flipped:
        modules[row, column] ^= 1
    rim = 3 * scale
    # light through a lens: blurred in linear light, then the sRGB curve (near enough a gamma of 2.2)
    light = np.pad(np.kron(modules, np.ones((scale, scale))), rim, constant_values=1.0)
    light = np.asarray(cv2.GaussianBlur(0.02 + 0.8 * light, (0, 0), 0.7))
    grey = np.rint(255.0 * light ** (1 / 2.2)).astype(np.uint8)
    low = rim + layout.margin_modules * scale - 0.5
    high = low + layout.border_modules * scale
    corners = np.array([[low, low], [high, low], [high, high], [low, high]])
    return np.repeat(grey[:, :, None], 3, axis=2), corners


def around(shot: Shot) -> Region:
    """The region that a tracker would search."""
    module = module_px(shot.corners_px, PAD.tags[0].family)
    low, high = shot.corners_px.min(axis=0) - 5 * module - 8, shot.corners_px.max(axis=0) + 5 * module + 8
    x0, y0 = np.maximum(low, 0).astype(int)
    x1, y1 = np.minimum(high, [shot.camera.width, shot.camera.height]).astype(int)
    return Region(int(x0), int(y0), int(x1), int(y1), module)


def only(tags: Sequence[TagObservation]) -> TagObservation:
    assert len(tags) == 1
    return tags[0]


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("quarter_turns", range(4))
def test_corners_begin_at_the_upright_tags_top_left(family: str, quarter_turns: int) -> None:
    image, corners = drawn(family, 7)
    n = len(image)
    for _ in range(quarter_turns):  # clockwise: (x, y) moves to (n - 1 - y, x)
        image = np.ascontiguousarray(np.rot90(image, -1))
        corners = np.column_stack([n - 1 - corners[:, 1], corners[:, 0]])
    found = only(TagReader(ReaderConfig({family: None})).read_frame(image))
    assert (found.family, found.tag_id, found.hamming) == (family, 7, 0)
    # the drawing's corners lie at -0.5 of whole pixels: a convention half a pixel off would show
    np.testing.assert_allclose(found.corners_px, corners, atol=0.03)


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_is_read_from_a_rendered_pad(family: str) -> None:
    pad = PadSpec(letter=None, quiet_zone=None, tags=(PadTag(family=family, id=3, size=0.3, yaw_deg=30.0),))
    shot = shoot(70.0, np.random.default_rng(1), pad=pad)
    found = only(TagReader(ReaderConfig.of_pad(pad)).read_frame(shot.image))
    np.testing.assert_allclose(found.corners_px, shot.corners_px, atol=0.08)


def test_corrected_bits_are_counted_and_limited() -> None:
    once, corners = drawn("tag36h11", 5, flipped=[(3, 3)])
    twice, _ = drawn("tag36h11", 5, flipped=[(3, 3), (5, 4)])
    wanted = {"tag36h11": frozenset({5})}
    found = only(TagReader(ReaderConfig(wanted, max_hamming=1)).read_frame(once))
    assert found.hamming == 1
    np.testing.assert_allclose(found.corners_px, corners, atol=0.1)
    assert TagReader(ReaderConfig(wanted, max_hamming=0)).read_frame(once) == ()
    assert TagReader(ReaderConfig(wanted, max_hamming=1)).read_frame(twice) == ()
    assert only(TagReader(ReaderConfig(wanted, max_hamming=2)).read_frame(twice)).hamming == 2


def test_families_with_few_bits_between_codes_take_no_correction() -> None:
    image, _ = drawn("tag16h5", 5, flipped=[(3, 3)])
    assert TagReader(ReaderConfig({"tag16h5": None}, max_hamming=2)).read_frame(image) == ()


def test_margin_and_ids_are_limits() -> None:
    image, _ = drawn("tag36h11", 5)
    margin = only(TagReader(ReaderConfig({"tag36h11": None})).read_frame(image)).margin
    assert margin > 50.0
    assert TagReader(ReaderConfig({"tag36h11": None}, min_margin=300.0)).read_frame(image) == ()
    assert TagReader(ReaderConfig({"tag36h11": frozenset({6, 7})})).read_frame(image) == ()
    assert only(TagReader(ReaderConfig({"tag36h11": frozenset({5, 7})})).read_frame(image)).tag_id == 5


def test_two_tags_with_one_id_stay_two() -> None:
    image, _ = drawn("tag36h11", 5)
    both = np.concatenate([image, image], axis=1)
    found = TagReader(ReaderConfig({"tag36h11": None})).read_frame(both)
    assert [tag.tag_id for tag in found] == [5, 5]
    np.testing.assert_allclose(found[1].corners_px - found[0].corners_px, [[image.shape[1], 0]] * 4, atol=0.02)


def test_tags_of_several_families_are_read_together() -> None:
    pictures = [cv2.copyMakeBorder(drawn(f, 1)[0], 0, 200, 0, 0, cv2.BORDER_REPLICATE)[:200] for f in FAMILIES[:3]]
    found = TagReader(ReaderConfig(dict.fromkeys(FAMILIES[:3]))).read_frame(np.concatenate(pictures, axis=1))
    assert sorted(tag.family for tag in found) == sorted(FAMILIES[:3])


def test_a_tag_cut_off_by_the_rim_is_not_read() -> None:
    image, corners = drawn("tag36h11", 5)
    reader = TagReader(ReaderConfig({"tag36h11": None}))
    whole, half_a_module = int(corners[2, 1]) + 3, int(corners[2, 1]) - 4
    assert len(reader.read_frame(np.ascontiguousarray(image[:whole]))) == 1
    assert reader.read_frame(np.ascontiguousarray(image[:half_a_module])) == ()


def test_region_and_frame_give_the_same_corners() -> None:
    rng = np.random.default_rng(2)
    for side in (15.0, 30.0, 90.0):
        shot = shoot(side, rng)
        frame, region = only(READER.read_frame(shot.image)), only(READER.read_region(shot.image, around(shot)))
        np.testing.assert_allclose(region.corners_px, frame.corners_px, atol=0.02)


def test_a_region_too_small_to_hold_a_tag_shows_none() -> None:
    shot = shoot(20.0, np.random.default_rng(3))
    assert READER.read_region(shot.image, Region(10, 10, 15, 40, 2.0)) == ()


def test_a_sure_tag_that_cannot_be_registered_keeps_honest_corners(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    shots = [shoot(side, rng) for side in (15.0, 20.0, 30.0, 60.0, 120.0)]
    weak, _ = drawn("tag16h5", 5)
    monkeypatch.setattr(reader_module, "register", lambda *_: None)
    for shot in shots:
        found = only(READER.read_region(shot.image, around(shot)))
        error = (found.corners_px - shot.corners_px).ravel()
        assert error @ np.linalg.solve(found.covariance_px2, error) < 20.0
        assert found.covariance_px2[0, 0] > 0.05
    assert TagReader(ReaderConfig({"tag16h5": None})).read_frame(weak) == ()


def test_a_covered_corner_is_dropped_or_within_its_stated_error() -> None:
    rng = np.random.default_rng(5)
    read = 0
    for _ in range(12):
        shot = shoot(60.0, rng, tilt_deg=(0.0, 20.0))
        x, y = shot.corners_px[0].astype(int)
        shot.image[y - 3 : y + 4, x - 3 : x + 4] = 90  # a leaf on the corner itself
        for found in READER.read_region(shot.image, around(shot)):
            read += 1
            assert np.abs(found.corners_px - shot.corners_px).max() < 0.3
    assert read >= 6


def region_reads(side: float, n: int, seed: int) -> int:
    rng = np.random.default_rng(seed)
    shots = [shoot(side, rng) for _ in range(n)]
    return sum(bool(READER.read_region(shot.image, around(shot))) for shot in shots)


def frame_reads(side: float, n: int, seed: int) -> int:
    """Count the pads read anywhere in whole pictures; a read counts only at the true place."""
    rng = np.random.default_rng(seed)
    reads = 0
    for _ in range(n):
        distance = CAMERA.fx * PAD.tag_size_m(PAD.tags[0]) / side
        reach = (np.array([CAMERA.cx, CAMERA.cy]) - side) / CAMERA.fx
        off = rng.uniform(-reach, reach)
        pose = view(distance, rng.uniform(0, 35), rng.uniform(0, 6.28), rng.uniform(0, 6.28), (off[0], off[1]))
        truth = tag_corners_px(CAMERA, pose, PAD, PAD.tags[0])
        found = READER.read_frame(photograph(pose, rng))
        reads += any(np.abs(tag.corners_px - truth).max() < 0.5 for tag in found)
    return reads


def test_small_tags_are_read_in_their_region() -> None:
    assert region_reads(13.0, 30, seed=6) >= 28
    assert region_reads(15.0, 30, seed=7) == 30
    assert region_reads(24.0, 10, seed=8) == 10


def test_small_tags_are_read_anywhere_in_the_picture() -> None:
    assert frame_reads(13.0, 10, seed=9) >= 9
    assert frame_reads(15.0, 10, seed=10) == 10


@pytest.mark.full
@pytest.mark.parametrize(("side", "share"), [(13, 0.9), (15, 1.0), (18, 1.0), (40, 1.0), (120, 1.0)])
def test_small_tags_are_read_always(side: float, share: float) -> None:
    assert region_reads(side, 200, seed=11) >= share * 200
    assert frame_reads(side, 60, seed=12) >= share * 60


def no_tag_is_seen(count: int, wanted: dict[str, frozenset[int] | None]) -> None:
    rng = np.random.default_rng(13)
    real = photographs()
    reader = TagReader(ReaderConfig(wanted))
    for index in range(count):
        found = reader.read_frame(clutter(index, rng, real))
        assert found == (), f"picture {index} of seed 13"


@pytest.mark.parametrize("family", FAMILIES)
def test_no_tag_is_seen_where_none_is(family: str) -> None:
    no_tag_is_seen(50, {family: None})


@pytest.mark.full
def test_no_tag_is_seen_in_five_thousand_pictures() -> None:
    no_tag_is_seen(5000, {"tag36h11": None})


@pytest.mark.full
def test_no_pads_tag_is_seen_in_five_thousand_pictures() -> None:
    no_tag_is_seen(5000, dict(ReaderConfig.of_pad(PAD).wanted))
