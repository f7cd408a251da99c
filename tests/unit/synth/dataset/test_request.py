from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.errors import InputError, UsageError
from landtool.io.run_record import HashedFile
from landtool.pad import Board, Letter, PadSpec, PadTag, QuietZone
from landtool.synth.dataset import DatasetRequest
from landtool.synth.dataset import backgrounds as backgrounds_module
from landtool.synth.dataset.backgrounds import find_backgrounds
from landtool.synth.domain import Domain

REQUEST = DatasetRequest(10, 0, (640, 480), (0.8, 0.1, 0.1), Domain(), PadSpec())


@pytest.mark.parametrize(
    ("n", "split", "counts"),
    [
        (1120, (0.8, 0.1, 0.1), {"train": 896, "val": 112, "test": 112}),
        (10, (0.8, 0.2), {"train": 8, "val": 2}),
        (1, (0.8, 0.1, 0.1), {"train": 1}),
        (7, (1 / 3, 1 / 3, 1 / 3), {"train": 3, "val": 2, "test": 2}),
        (13, (0.7, 0.2, 0.1), {"train": 9, "val": 3, "test": 1}),
        (5, (1.0, 0.0), {"train": 5}),
    ],
)
def test_splits_have_their_exact_share(n: int, split: tuple[float, ...], counts: dict[str, int]) -> None:
    assert Counter(replace(REQUEST, n=n, split=split).split_of_images()) == counts


def test_splits_are_drawn_by_the_seed() -> None:
    request = replace(REQUEST, n=100)
    assert request.split_of_images() == request.split_of_images()
    assert request.split_of_images() != replace(request, seed=1).split_of_images()
    assert request.split_of_images()[:80] != ["train"] * 80


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"n": 0}, "0 images cannot be made"),
        ({"n": -3}, "-3 images cannot be made"),
        ({"seed": -1}, "seed = -1 is negative"),
        ({"size": (63, 480)}, "a picture of 63x480 cannot be made; give 64 to 4096"),
        ({"size": (640, 100_000)}, "a picture of 640x100000 cannot be made"),
        ({"split": (0.8, 0.1)}, r"split 0.8,0.1 adds up to 0.9; .* must add up to 1"),
        ({"split": (0.8, 0.1, 0.2)}, "adds up to 1.1"),
        ({"split": (1.2, -0.2)}, "split 1.2,-0.2 is impossible"),
        ({"split": (1.0,)}, "split 1 is impossible"),
        ({"split": (0.0, 1.0)}, "split 0,1 is impossible"),
        ({"split": (0.25,) * 4}, "is impossible"),
        ({"split": (float("nan"), 0.5)}, "is impossible"),
    ],
)
def test_what_cannot_be_made(change: dict[str, object], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        replace(REQUEST, **change)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("tags", "said"),
    [
        # with its white border a tag is 10/8 of its size
        ((PadTag(size=0.68),), "tag 5 with its white border lies on the ring"),
        ((PadTag(size=0.2, x=0.4),), "lies on the ring"),
        ((PadTag(size=0.1, x=0.51),), "does not fit on the board"),
        ((PadTag(size=0.9),), "does not fit on the board"),
        ((PadTag(size=0.1), PadTag(id=6, size=0.1, x=0.1)), "tags 5 and 6 lie on each other"),
    ],
)
def test_a_tag_that_does_not_fit(tags: tuple[PadTag, ...], said: str) -> None:
    with pytest.raises(InputError, match=said):
        replace(REQUEST, pad=PadSpec(tags=tags))


@pytest.mark.parametrize(
    "pad",
    [
        PadSpec(tags=(PadTag(size=0.45),)),
        PadSpec(tags=(PadTag(size=0.1), PadTag(id=6, size=0.1, x=0.2, yaw_deg=45.0))),
        # in a corner of the board, outside the ring
        PadSpec(tags=(PadTag(size=0.08, x=0.48, y=0.48),)),
        PadSpec(tags=(), board=None),
        PadSpec(diameter_m=0.18),
    ],
)
def test_tags_that_fit(pad: PadSpec) -> None:
    assert replace(REQUEST, pad=pad).pad == pad


@pytest.mark.parametrize(
    ("pad", "reason"),
    [
        (PadSpec(ring=None), "the pad has no ring"),
        (PadSpec(quiet_zone=QuietZone(side=3.0)), "the quiet zone lies on the ring"),
        (PadSpec(letter=Letter(height=0.8, width=0.6)), "the H lies on the ring"),
        (PadSpec(board=Board(side=0.9)), "the ring sticks out of the board"),
    ],
)
def test_a_ring_that_cannot_be_seen_whole_is_refused(pad: PadSpec, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        replace(REQUEST, pad=pad)


def test_every_part_of_a_request_tells_two_apart() -> None:
    others = [
        replace(REQUEST, n=11),
        replace(REQUEST, seed=1),
        replace(REQUEST, size=(320, 240)),
        replace(REQUEST, split=(0.9, 0.05, 0.05)),
        replace(REQUEST, domain=Domain(fog=0.5)),
        replace(REQUEST, pad=PadSpec(diameter_m=2.0)),
        replace(REQUEST, photos=(HashedFile("a.jpg", "00"),)),
        replace(REQUEST, clear=True),
        REQUEST,
    ]
    assert len({request.as_text() for request in others}) == len(others)


class TestBackgrounds:
    @pytest.fixture
    def photos(self, tmp_path: Path) -> Path:
        """Return a folder of photographs, with some in a folder of its own and one hidden."""
        for name in ("a10.jpg", "a2.png", "deep/b.jpg", ".thumbs/c.jpg"):
            path = tmp_path / name
            path.parent.mkdir(exist_ok=True)
            cv2.imwrite(str(path), np.random.default_rng(0).integers(0, 255, (80, 90, 3), np.uint8))
        (tmp_path / "notes.txt").write_text("mine")
        return tmp_path

    def test_a_folder_and_what_is_in_it(self, photos: Path) -> None:
        found = find_backgrounds([str(photos), str(photos / "deep")])
        assert [Path(photo.path).name for photo in found] == ["a2.png", "a10.jpg", "b.jpg"]
        assert find_backgrounds([]) == ()

    def test_scikit_image_is_found_without_importing_it(self, photos: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (photos / "skimage/data").mkdir(parents=True)
        (photos / "skimage/__init__.py").write_text("raise ImportError('not needed')")
        (photos / "a2.png").rename(photos / "skimage/data/coffee.png")
        monkeypatch.syspath_prepend(str(photos))
        (found,) = find_backgrounds(["scikit-image"])
        assert found.path == str(photos / "skimage/data/coffee.png")

    def test_scikit_image_is_not_there(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(backgrounds_module.importlib.util, "find_spec", lambda _: None)
        with pytest.raises(UsageError, match="scikit-image is not installed; python -m pip install scikit-image"):
            find_backgrounds(["scikit-image"])

    def test_what_is_no_folder_of_photographs(self, photos: Path) -> None:
        (photos / "empty").mkdir()
        for name, kind, said in (
            ("none", UsageError, "does not exist"),
            ("a10.jpg", UsageError, "is no folder"),
            ("empty", InputError, "holds no photographs"),
        ):
            with pytest.raises(kind, match=rf"{name}: {said}"):
                find_backgrounds([str(photos / name)])

    def test_a_broken_photograph_is_named(self, photos: Path) -> None:
        whole = (photos / "deep/b.jpg").read_bytes()
        for content, said in ((whole[:500], "cannot be decoded"), (b"", "is empty"), (b"text", "is no image")):
            (photos / "deep/b.jpg").write_bytes(content)
            with pytest.raises(InputError, match=rf"deep/b\.jpg: {said}"):
                find_backgrounds([str(photos)])

    def test_a_tiny_one_too(self, photos: Path) -> None:
        cv2.imwrite(str(photos / "tiny.png"), np.zeros((20, 300, 3), np.uint8))
        with pytest.raises(InputError, match=r"tiny\.png: is 300x20 pixels, too small"):
            find_backgrounds([str(photos)])
