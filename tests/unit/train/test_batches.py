from __future__ import annotations

import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.darknet.cfg import parse_cfg
from landtool.errors import InputError
from landtool.io.labels import LabelledBox, LabelledImage
from landtool.train.batches import Batch, BatchMaker
from landtool.train.samples import Example, FolderSamples
from landtool.train.settings import TrainSettings
from tests.unit.darknet.networks import SMALL

NETWORK = parse_cfg(SMALL)  # 64 x 32
SETTINGS = TrainSettings(batch=3, sides=(64, 96), mosaic=0.4, whole=0.3, seed=5)


class Noise:
    """Pictures of noise with a target each; asked: the numbers that were asked for."""

    def __init__(self, count: int = 20, broken: int = -1) -> None:
        self._count, self._broken = count, broken
        self.asked: list[int] = []

    def pool(self, iteration: int) -> range:
        return range(iteration, iteration + self._count)

    def example(self, index: int) -> Example:
        self.asked.append(index)
        if index == self._broken:
            raise InputError("is cut", file=f"{index}.jpg")
        rng = np.random.default_rng(index)
        if index % 3 == 0:
            time.sleep(0.002)
        image = rng.integers(0, 256, (120, 160, 3), np.uint8)
        return Example.of(image, np.array([[20.0, 30.0, 90.0, 80.0]]), [index % 2])


def same(a: Batch, b: Batch) -> bool:
    names = ("pictures", "boxes", "picture", "label", "ignored")
    return a.iteration == b.iteration and all(np.array_equal(getattr(a, n), getattr(b, n)) for n in names)


def test_a_batch_follows_from_its_number_alone() -> None:
    one_by_one = [BatchMaker(Noise(), NETWORK, SETTINGS).batch(k) for k in range(12)]
    maker = BatchMaker(Noise(), NETWORK, SETTINGS)
    assert all(same(maker.batch(k), one_by_one[k]) for k in (11, 0, 7, 3, 3))
    assert not same(BatchMaker(Noise(), NETWORK, TrainSettings(batch=3, sides=(64,), seed=6)).batch(0), one_by_one[0])
    assert len({batch.pictures.tobytes() for batch in one_by_one}) == 12


def test_a_batch_is_made_of_arrays_that_fit_together() -> None:
    sizes = set()
    for iteration in range(0, 200, 10):
        batch = BatchMaker(Noise(), NETWORK, SETTINGS).batch(iteration)
        height, width = batch.pictures.shape[1:3]
        sizes.add((width, height))
        assert batch.pictures.shape == (3, height, width, 3)
        assert batch.pictures.dtype == np.uint8
        assert batch.boxes.dtype == np.float32
        assert batch.picture.dtype == batch.label.dtype == np.int64
        assert batch.ignored.dtype == np.bool_
        assert len(batch.boxes) == len(batch.picture) == len(batch.label) == len(batch.ignored)
        low, high = batch.boxes[:, :2] - batch.boxes[:, 2:] / 2, batch.boxes[:, :2] + batch.boxes[:, 2:] / 2
        assert (low >= -1e-3).all()
        assert (high <= np.array([width, height]) + 1e-3).all()
        assert set(batch.picture.tolist()) <= {0, 1, 2}
    assert sizes == {(64, 32), (64, 64), (96, 96)}


def test_ten_batches_have_one_size() -> None:
    maker = BatchMaker(Noise(), NETWORK, SETTINGS)
    assert len({maker.batch(k).pictures.shape for k in range(20, 30)}) == 1


def test_pictures_come_from_the_pool_of_the_iteration() -> None:
    samples = Noise(count=4)
    maker = BatchMaker(samples, NETWORK, SETTINGS)
    for iteration in range(30):
        samples.asked.clear()
        maker.batch(iteration)
        assert len(samples.asked) >= 3
        assert set(samples.asked) <= set(range(iteration, iteration + 4))


def test_all_of_a_pool_is_drawn_from() -> None:
    samples = Noise(count=4)
    maker = BatchMaker(samples, NETWORK, TrainSettings(batch=40, sides=(64,), whole=0.0, mosaic=0.0))
    maker.batch(0)
    assert set(samples.asked) == {0, 1, 2, 3}


def test_pictures_are_rgb() -> None:
    class Blue(Noise):
        def example(self, index: int) -> Example:
            image = np.zeros((120, 160, 3), np.uint8)
            image[..., 0] = 200
            return Example.of(image, np.array([[20.0, 30.0, 90.0, 80.0]]), [index % 2])

    plain = TrainSettings(batch=2, whole=1.0, zoom=1.0, degrade=0.0, hue=0.0, saturation=1.0, exposure=1.0)
    picture = BatchMaker(Blue(), NETWORK, plain).batch(0).pictures[0]
    assert picture[16, 32].tolist() == [0, 0, 200]


@pytest.mark.parametrize("workers", [1, 3])
def test_batches_made_ahead_come_in_order(workers: int) -> None:
    maker = BatchMaker(Noise(), NETWORK, SETTINGS)
    ahead = list(maker.ahead(4, 14, workers))
    assert [batch.iteration for batch in ahead] == list(range(4, 14))
    assert all(same(batch, maker.batch(batch.iteration)) for batch in ahead)


def test_a_broken_picture_ends_it_with_its_own_error() -> None:
    maker = BatchMaker(Noise(count=1, broken=6), NETWORK, SETTINGS)
    ahead = maker.ahead(0, 50)
    assert [next(ahead).iteration for _ in range(6)] == list(range(6))
    with pytest.raises(InputError, match=r"6\.jpg: is cut"):
        next(ahead)


def test_batches_made_ahead_can_be_left_alone() -> None:
    samples = Noise()
    ahead = BatchMaker(samples, NETWORK, SETTINGS).ahead(0, 10**6)
    next(ahead)
    ahead.close()  # type: ignore[attr-defined]
    asked = len(samples.asked)
    time.sleep(0.05)
    assert len(samples.asked) == asked < 200


def test_pictures_of_a_folder(tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 256, (20, 30, 3), np.uint8)
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(tmp_path / name), image)
    cut = tmp_path / "c.jpg"
    _, jpeg = cv2.imencode(".jpg", image)
    cut.write_bytes(jpeg.tobytes()[: len(jpeg) // 2])
    boxes = {"a.png": (LabelledBox(1, -0.5, 3.5, 9.5, 19.5),), "b.png": (), "c.jpg": ()}
    samples = FolderSamples([LabelledImage(tmp_path / name, 30, 20, found) for name, found in boxes.items()])
    assert samples.pool(0) == samples.pool(99) == range(3)
    first = samples.example(0)
    assert (first.image == image).all()
    assert first.boxes.tolist() == [[0.0, 4.0, 10.0, 20.0]]
    assert first.labels.tolist() == [1]
    assert samples.example(1).boxes.shape == (0, 4)
    with pytest.raises(InputError, match=r"c\.jpg: .*; remove it from the data set"):
        samples.example(2)
