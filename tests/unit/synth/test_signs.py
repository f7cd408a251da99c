import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.families import tag_family
from landtool.pad import PadSpec, PadTag
from landtool.synth import signs
from landtool.synth.signs import LOOKALIKES, SIGNS, make_sign, random_sign
from landtool.synth.signs.canvas import BLACK, RED, SIDE, WHITE, Canvas
from landtool.tags.reader import ReaderConfig, TagReader

PAD = PadSpec()


def drawn_pad() -> np.ndarray:
    """The pad as a sign would be painted, its tag too."""
    scale = 2.0 / 1.1
    canvas = Canvas()
    canvas.square(1.1, WHITE)
    canvas.ring(0.5 * scale, 0.42 * scale, RED, WHITE)
    canvas.letter_h(0.6 * scale, 0.52 * scale, 0.1 * scale, BLACK)
    canvas.modules(tag_family("tag36h11").modules(5), 0.0, 0.0, 0.1 * scale, BLACK, WHITE)
    return canvas.picture()


REFERENCE = drawn_pad()


def looks_like_the_pad(picture: np.ndarray) -> bool:
    """Whether a picture has a whole red ring where the pad has it, and an H inside it and nothing else."""
    y, x = np.mgrid[0:SIDE, 0:SIDE] - (SIDE - 1) / 2.0
    away = np.hypot(x, y) / (SIDE / 2.2)
    on_ring, inside = (away > 0.87) & (away < 0.97), (away < 0.8) & (np.maximum(abs(x), abs(y)) > 0.2 * SIDE / 2.2)
    reference_dark = REFERENCE[:, :, :3].max(axis=2) < 100
    for turns in range(4):
        turned = np.rot90(picture, turns).astype(int)
        seen = turned[:, :, 3] > 100
        red = seen & (turned[:, :, 2] > 1.5 * np.maximum(turned[:, :, 0], turned[:, :, 1]))
        dark = seen & (turned[:, :, :3].max(axis=2) < 110)
        same = (dark == reference_dark)[inside].mean()
        if red[on_ring].mean() > 0.8 and same > 0.93:
            return True
    return False


def test_the_check_knows_the_pad() -> None:
    assert looks_like_the_pad(REFERENCE)
    assert looks_like_the_pad(np.rot90(REFERENCE))


@pytest.mark.parametrize("name", SIGNS)
def test_a_sign_is_a_picture_that_is_not_the_pad(name: str) -> None:
    for seed in range(8):
        picture = make_sign(name, np.random.default_rng(seed), PAD)
        assert picture.shape == (256, 256, 4)
        assert picture.dtype == np.uint8
        assert (picture[:, :, 3] > 100).mean() > 0.02
        assert not looks_like_the_pad(picture)


@pytest.mark.parametrize("name", SIGNS)
def test_the_same_state_gives_the_same_sign_and_another_state_another(name: str) -> None:
    first, second, other = (make_sign(name, np.random.default_rng(seed), PAD).tobytes() for seed in (7, 7, 8))
    assert first == second
    assert first != other


def test_round_signs_have_soft_edges_and_nothing_in_their_corners() -> None:
    cover = SIGNS["no-entry"](np.random.default_rng(0), PAD)[:, :, 3]
    assert cover[0, 0] == 0
    assert cover[128, 128] == 255
    values = np.unique(cover)
    assert len(values) > 10


@pytest.mark.parametrize("name", ["ring-tag", "tag-on-board"])
def test_tags_on_signs_are_read_and_are_never_the_pads(name: str) -> None:
    reader = TagReader(ReaderConfig({"tag36h11": None}))
    # a pad that has all tags but three leaves only these for its signs
    crowded = PadSpec(tags=tuple(PadTag(id=i) for i in range(584)))
    pictures = [SIGNS[name](np.random.default_rng(seed), crowded) for seed in range(12)]
    read = [reader.read_frame(np.ascontiguousarray(picture[:, :, :3])) for picture in pictures]
    assert sum(len(tags) for tags in read) >= 6
    assert {tag.tag_id for tags in read for tag in tags} <= {584, 585, 586}


def test_an_unknown_sign_is_refused() -> None:
    with pytest.raises(UsageError, match="no sign 'pad'"):
        make_sign("pad", np.random.default_rng(0), PAD)


def test_random_signs_are_of_all_sorts_and_more_often_lookalikes() -> None:
    rng = np.random.default_rng(1)
    names = [random_sign(rng, PAD)[0] for _ in range(120)]
    assert set(names) <= set(SIGNS)
    assert len(set(names)) > 30
    assert 0.5 < sum(name in LOOKALIKES for name in names) / len(names) < 0.75


def test_what_lies_flat_is_a_sign() -> None:
    assert set(SIGNS) >= signs.FLAT >= signs.PAINTED


def test_signs_suit_a_pad_without_letter_ring_or_board() -> None:
    bare = PadSpec(board=None, ring=None, letter=None, quiet_zone=None)
    for name in LOOKALIKES:
        assert make_sign(name, np.random.default_rng(2), bare)[:, :, 3].any()
