"""What dehazing is worth to the network, on pictures made up so that the answer is known."""

from __future__ import annotations

from pathlib import Path

import pytest

from landtool.evaluate.detection_metrics import ScoredPicture
from landtool.evaluate.downstream import downstream_metrics
from landtool.evaluate.facts import Facts
from landtool.io.labels import LabelledBox, LabelledImage
from landtool.types import Detection

BOX = (10.0, 10.0, 30.0, 30.0)


def picture(number: int, *scores: float, fog: float | None = 0.1, off_px: float = 0.0) -> ScoredPicture:
    file = f"{number}.jpg"
    image = LabelledImage(Path(file), 100, 80, (LabelledBox(0, *BOX),))
    box = BOX[0] + off_px, BOX[1], BOX[2] + off_px, BOX[3]
    found = tuple(Detection("pad", score, *box) for score in scores)
    return ScoredPicture("set", file, None, file, image, found, Facts(fog_per_m=fog))


def test_the_gain_is_paired() -> None:
    # found without: every second; with: all but one, which the other way lost, too
    off = [picture(i, *((0.9,) if i % 2 else (0.1,))) for i in range(20)]
    auto = [picture(i, 0.9 if i else 0.1) for i in range(20)]
    clear = [picture(99, fog=0.0), picture(98, fog=None)]
    found = {m.key: m for m in downstream_metrics([*off, *clear], [*clear, *reversed(auto)], ["pad"], conf=0.25)}
    assert found["dehaze.recall_off"].value == pytest.approx(0.5)
    assert found["dehaze.recall_auto"].value == pytest.approx(0.95)
    gain = found["dehaze.recall_gain"]
    assert (gain.value, gain.count, gain.of, gain.better) == (pytest.approx(0.45), 20, 20, "higher")
    assert gain.low is not None
    assert gain.high is not None
    assert 0.2 < gain.low < 0.45 < gain.high < 0.7
    assert found["dehaze.map50_off"].value == found["dehaze.map50_auto"].value == pytest.approx(1.0)
    gain = found["dehaze.map50_gain"]
    assert (gain.value, gain.low, gain.high) == (pytest.approx(0.0), None, None)


def test_the_average_precision_falls_with_what_is_beside_the_target() -> None:
    off = [picture(i, 0.9) for i in range(6)]
    auto = [picture(i, 0.9, off_px=40.0 * (i < 3)) for i in range(6)]
    found = {m.name: m.value for m in downstream_metrics(off, auto, ["pad"], conf=0.25)}
    assert found["map50_off"] == pytest.approx(1.0)
    assert found["map50_gain"] == pytest.approx((found["map50_auto"] or 0.0) - 1.0)
    assert (found["map50_auto"] or 1.0) < 0.6


@pytest.mark.parametrize("pictures", [[], [picture(1, 0.9, fog=0.0)]])
def test_without_fog_all_is_undefined(pictures: list[ScoredPicture]) -> None:
    found = downstream_metrics(pictures, pictures, ["pad"], conf=0.25)
    names = [f"{kind}_{which}" for kind in ("recall", "map50") for which in ("off", "auto", "gain")]
    assert [metric.name for metric in found] == names
    assert all(metric.said == "undefined, 0 of 0" for metric in found)


def test_a_picture_that_was_not_looked_at_twice() -> None:
    with pytest.raises(ValueError, match=r"not looked at with dehazing: 2\.jpg"):
        downstream_metrics([picture(2, 0.9)], [picture(1, 0.9)], ["pad"], conf=0.25)
