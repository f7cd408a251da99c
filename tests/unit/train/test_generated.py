"""Pictures drawn while a training goes on, by the stand-ins of the dataset's tests."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import CancelledError, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
import pytest

from landtool.errors import InputError, LandtoolError, UsageError
from landtool.pad import PadSpec
from landtool.synth.domain import Domain
from landtool.synth.make_sample import make_sample
from landtool.train.generated import GeneratedSamples
from tests.unit.synth.dataset import plain

SIZE = (96, 64)


def samples(draw: Callable[..., Any] = plain.draw, drawn: Path | None = None, **how: Any) -> GeneratedSamples:
    domain = plain.PlainDomain(drawn=str(drawn or ""), trouble_at=how.pop("trouble_at", -1))
    how = {"first": 4, "fresh": 0.5, "keep": 6, "jobs": 1, **how}
    return GeneratedSamples(cast(Domain, domain), PadSpec(), SIZE, 7, draw=cast(Any, draw), **how)


def test_the_pool_follows_from_the_iteration() -> None:
    pictures = samples()
    assert [pictures._range(i) for i in (0, 1, 2, 4, 6, 100)] == [
        range(4), range(4), range(5), range(6), range(1, 7), range(48, 54),
    ]  # fmt: skip


def test_pictures_are_those_of_the_seed_in_any_order() -> None:
    with samples(jobs=2) as pictures, ThreadPoolExecutor(3) as threads:
        assert pictures.pool(0) == range(4)
        found = list(threads.map(pictures.example, (3, 0, 2, 1, 3)))
        assert pictures.pool(40) == range(18, 24)
        late = pictures.example(1)  # dropped by now, drawn again
    for index, example in zip((3, 0, 2, 1, 3, 1), (*found, late), strict=True):
        sample = plain.draw(plain.PlainDomain(), PadSpec(), SIZE, 7, index, ())
        wanted = cv2.imdecode(np.frombuffer(sample.jpeg, np.uint8), cv2.IMREAD_COLOR)
        assert (example.image == wanted).all()
        # box of plain.draw: pixels 20 to 49 across and 10 to 19 down, whose edges count from 0
        assert example.boxes.tolist() == ([[20.0, 10.0, 50.0, 20.0]] if index % 3 else [])
        assert example.labels.tolist() == [0] * len(example.boxes)
        assert not example.ignored.any()


def test_only_what_steps_may_use_soon_is_drawn_and_kept(tmp_path: Path) -> None:
    drawn = tmp_path / "drawn"
    with samples(drawn=drawn) as pictures:
        pictures.pool(100)  # as when resumed
        pictures.example(60)
        pictures.example(63)  # the last of those drawn ahead: 4 + 0.5 * (100 + 20) - 1
        pictures.example(48)
        kept = set(pictures._pictures)
    indices = [int(line) for line in drawn.read_text().split()]
    assert {48, 60, 63} <= set(indices) <= set(range(48, 64))
    assert {48, 60, 63} <= kept <= set(range(48, 64))  # some of them may be under way still
    assert len(set(indices)) == len(indices)


def test_old_pictures_are_dropped() -> None:
    with samples(fresh=1.0) as pictures:
        for iteration in range(0, 30, 3):
            for index in pictures.pool(iteration):
                pictures.example(index)
        assert min(pictures._pictures) == pictures.pool(27).start == 25
        assert len(pictures._pictures) <= 6 + 20


def test_pictures_to_validate_on_are_of_another_seed() -> None:
    with samples() as pictures:
        images, examples = pictures.labelled(8, 3)
        own = pictures.example(1)
    assert [len(image.boxes) for image in images] == [0, 1, 1] == [len(example.boxes) for example in examples]
    box = images[1].boxes[0]
    assert (box.class_id, box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px) == (0, 19.5, 9.5, 49.5, 19.5)
    assert (images[1].width, images[1].height) == SIZE
    assert len({image.path for image in images}) == 3
    assert not (examples[1].image == own.image).all()


def test_what_goes_wrong_in_a_process_is_told_to_whoever_waits() -> None:
    with samples(plain.draw_or_fail, trouble_at=2) as pictures:
        pictures.example(1)
        with pytest.raises(InputError, match=r"photo\.jpg: is bad; remove it"):
            pictures.example(2)
        pictures.example(3)


def test_a_killed_process_is_one_clear_line() -> None:
    with samples(plain.draw_and_die, trouble_at=2) as pictures:
        for index in (2, 3):
            with pytest.raises(LandtoolError, match="a process that draws was killed; out of memory, perhaps"):
                pictures.example(index)


def test_nobody_waits_for_ever_when_it_ends() -> None:
    with ThreadPoolExecutor(1) as thread:
        with samples(plain.draw_slowly) as pictures:
            waiting = thread.submit(lambda: [pictures.example(index) for index in range(1000)])
            pictures.example(2)
        with pytest.raises((CancelledError, RuntimeError)):
            waiting.result(timeout=10)


@pytest.mark.parametrize("wrong", [{"first": 0}, {"keep": 0}, {"jobs": 0}, {"fresh": -1.0}, {"fresh": float("nan")}])
def test_numbers_that_leave_nothing_to_learn_from_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(UsageError, match=next(iter(wrong))):
        samples(**wrong)


def test_it_is_the_picture_of_the_dataset() -> None:
    domain = replace(Domain(), absent=0.0)
    with GeneratedSamples(domain, PadSpec(), SIZE, 3, first=1, fresh=0.0, keep=1, jobs=1) as pictures:
        example = pictures.example(0)
    sample = make_sample(domain, PadSpec(), SIZE, 3, 0)
    assert sample.truth.box_px is not None
    assert (example.image == sample.image).all()
    assert np.allclose(example.boxes[0], sample.truth.box_px + 0.5)
