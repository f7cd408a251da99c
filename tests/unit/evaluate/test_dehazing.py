"""What a dehazer is measured by: pairs found, PSNR and SSIM, gains with intervals, and what it does in clear air."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.dehaze.config import DehazeConfig
from landtool.dehaze.stage import dehazed
from landtool.errors import InputError
from landtool.evaluate.dehazing import (
    MOST_DB,
    ClearChange,
    PairScore,
    ScoredPair,
    change_levels,
    dehaze_metrics,
    find_pairs,
    pair_score,
    psnr_db,
    ssim,
)
from landtool.evaluate.metric import Metric
from landtool.io.images import read_picture
from landtool.types import Image
from tests.golden.clip import FIXTURES
from tests.shared import shared_data


def noise(seed: int, height: int = 24, width: int = 30) -> Image:
    smooth = cv2.GaussianBlur(np.random.default_rng(seed).uniform(0, 255, (height, width, 3)), (0, 0), 1.5)
    return np.asarray(np.clip(smooth, 0, 255), np.uint8)


def slow_ssim(image: Image, clear: Image) -> float:
    """Wang et al. 2004, equations 13 to 16, window by window."""
    offsets = np.arange(-5, 6)
    window = np.exp(-(offsets[:, None] ** 2 + offsets[None, :] ** 2) / (2.0 * 1.5**2))
    window /= window.sum()
    c1, c2 = (0.01 * 255.0) ** 2, (0.03 * 255.0) ** 2
    values = []
    for channel in range(3):
        for row in range(5, image.shape[0] - 5):
            for column in range(5, image.shape[1] - 5):
                here = slice(row - 5, row + 6), slice(column - 5, column + 6), channel
                x, y = image[here].astype(np.float64), clear[here].astype(np.float64)
                mx, my = (window * x).sum(), (window * y).sum()
                vx, vy = (window * (x - mx) ** 2).sum(), (window * (y - my) ** 2).sum()
                both = (window * (x - mx) * (y - my)).sum()
                values.append((2 * mx * my + c1) * (2 * both + c2) / ((mx**2 + my**2 + c1) * (vx + vy + c2)))
    return float(np.mean(values))


class TestAlikeness:
    def test_ssim_is_that_of_its_definition(self) -> None:
        clear = noise(0)
        for other in (noise(1), np.asarray(clear // 2 + 60, np.uint8), np.zeros_like(clear)):
            assert ssim(other, clear) == pytest.approx(slow_ssim(other, clear), abs=2e-5)

    def test_psnr_is_that_of_its_definition(self) -> None:
        image, clear = noise(2), noise(3)
        square = float(((image.astype(float) - clear.astype(float)) ** 2).mean())
        assert psnr_db(image, clear) == pytest.approx(10 * math.log10(255**2 / square))
        assert psnr_db(np.full((20, 20, 3), 100, np.uint8), np.full((20, 20, 3), 110, np.uint8)) == pytest.approx(
            28.13, abs=0.01
        )

    def test_equal_pictures_have_finite_numbers(self) -> None:
        image = noise(4)
        score = pair_score(image, image, image)
        assert score == PairScore(MOST_DB, MOST_DB, pytest.approx(1.0), pytest.approx(1.0))
        assert change_levels(image, image) == 0.0
        assert change_levels(image, np.asarray(255 - image, np.uint8)) > 10.0

    def test_pictures_that_cannot_be_compared(self) -> None:
        with pytest.raises(
            InputError, match="a picture of 30x24 and its clear twin of 31x24; give pictures of one size"
        ):
            psnr_db(noise(0), noise(0, 24, 31))
        with pytest.raises(InputError, match="a picture of 30x10 is too small"):
            pair_score(*3 * (noise(0, 10, 30),))


def put(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")


class TestPairs:
    def test_of_the_fixtures(self) -> None:
        pairs = find_pairs(FIXTURES / "stills")
        assert len(pairs) == 11
        assert all(pair.fog_per_m is not None and pair.fog_per_m > 0.0 for pair in pairs)
        assert pairs[0].name == "images/test/000010.jpg"
        assert pairs[0].hazy == FIXTURES / "stills/images/test/000010.jpg"
        assert pairs[0].clear == FIXTURES / "stills/clear/test/000010.jpg"

    def test_of_one_folder(self, tmp_path: Path) -> None:
        put(
            tmp_path,
            "fog_2.png",
            "clear_2.jpg",
            "fog_10.png",
            "clear_10.png",
            "clear_3.png",
            "depth_2.png",
            "fog_9.csv",
        )
        (tmp_path / "labels.csv").write_text("file,beta\nsomewhere/fog_2.png,0.25\nsomewhere/fog_10.png,\n")
        found = find_pairs(tmp_path)
        assert [(p.name, p.clear.name, p.fog_per_m) for p in found] == [
            ("fog_2.png", "clear_2.jpg", 0.25),
            ("fog_10.png", "clear_10.png", None),
        ]

    def test_of_two_folders(self, tmp_path: Path) -> None:
        put(tmp_path, *(f"clear/{n}.png" for n in (1, 10, 11)))
        put(tmp_path, "hazy/1_0.8_0.2.jpg", "hazy/10_0.8_0.1.jpg", "hazy/11.png")
        found = find_pairs(tmp_path)
        assert [(p.name, p.clear.name) for p in found] == [
            ("1_0.8_0.2.jpg", "1.png"),
            ("10_0.8_0.1.jpg", "10.png"),
            ("11.png", "11.png"),
        ]

    def test_without_pairs_there_are_none(self, tmp_path: Path) -> None:
        put(tmp_path, "images/train/1.jpg", "fog_1.png", "hazy/2.png")
        assert find_pairs(tmp_path) == ()

    @pytest.mark.parametrize(
        ("names", "said"),
        [
            (("images/val/1.jpg", "clear/val/2.jpg"), r"2\.jpg: is no twin of a picture in images/"),
            (("fog_1.png", "clear_2.png"), r"fog_1\.png: has no twin in clear air"),
            (("hazy/10_1.png", "clear/1.png"), r"10_1\.png: has no twin in clear air"),
        ],
    )
    def test_a_lost_half_is_named(self, tmp_path: Path, names: tuple[str, str], said: str) -> None:
        put(tmp_path, *names)
        with pytest.raises(InputError, match=said):
            find_pairs(tmp_path)

    def test_a_twin_that_is_gone_is_named(self, tmp_path: Path) -> None:
        put(tmp_path, "images/val/1.jpg", "images/val/2.jpg", "images/val/3.jpg", "clear/val/1.jpg")
        (tmp_path / "truth.csv").write_text(
            "file,beta_per_m\nimages/val/1.jpg,0.1\nimages/val/2.jpg,0.2\nimages/val/3.jpg,0\n"
        )
        with pytest.raises(InputError, match=r"2\.jpg: has no twin in clear air"):
            find_pairs(tmp_path)

    def test_a_broken_table_is_named(self, tmp_path: Path) -> None:
        put(tmp_path, "fog_2.png", "clear_2.png")
        (tmp_path / "labels.csv").write_text("file,beta\nfog_2.png,nan\n")
        with pytest.raises(InputError, match=r"labels\.csv: line 2: beta 'nan' is not a finite number"):
            find_pairs(tmp_path)


def scored(gain_db: float, gain: float, fog: float | None, number: int) -> ScoredPair:
    return ScoredPair("set", f"{number}.jpg", number, fog, 0.5, PairScore(18.0, 18.0 + gain_db, 0.7, 0.7 + gain))


def by_key(metrics: list[Metric]) -> dict[str, Metric]:
    found = {metric.key: metric for metric in metrics}
    assert len(found) == len(metrics)
    return found


class TestMetrics:
    def test_gains_and_the_fog_they_are_of(self) -> None:
        scores = [scored(2.0, 0.1, 0.03, i) for i in range(6)] + [scored(-4.0, 0.1, 0.15, i) for i in range(6, 8)]
        found = by_key(dehaze_metrics(scores, [ClearChange(i, 3.0 * (i == 0)) for i in range(6)]))
        gain = found["dehaze.psnr_gain_db_mean"]
        assert (gain.value, gain.count, gain.of, gain.better) == (pytest.approx(0.5), 8, 8, "higher")
        assert gain.low is not None
        assert gain.high is not None
        assert -3.0 < gain.low < 0.5 < gain.high <= 2.0
        assert found["dehaze.psnr_gain_db_mean:fog_per_m=0-0.05"].value == pytest.approx(2.0)
        assert found["dehaze.psnr_gain_db_mean:fog_per_m=0.1-0.2"].value == pytest.approx(-4.0)
        assert found["dehaze.psnr_before_db"].value == pytest.approx(18.0)
        assert found["dehaze.psnr_after_db"].value == pytest.approx(18.5)
        assert found["dehaze.ssim_after"].value == pytest.approx(0.8)
        assert found["dehaze.better_share"].value == pytest.approx(0.75)
        worst = found["dehaze.worst_db"]
        assert (worst.value, worst.low, worst.count) == (pytest.approx(-4.0), None, 8)
        assert found["dehaze.clear_change_levels"].value == pytest.approx(0.5)
        assert found["dehaze.clear_changed_share"].value == pytest.approx(1 / 6)

    def test_without_pairs_all_is_undefined(self) -> None:
        found = by_key(dehaze_metrics([], []))
        assert sorted(metric.name for metric in found.values()) == [
            *("better_share", "clear_change_levels", "clear_changed_share", "psnr_after_db", "psnr_before_db"),
            *("psnr_gain_db_mean", "ssim_after", "ssim_before", "ssim_gain", "worst_db"),
        ]
        assert all(metric.said == "undefined, 0 of 0" for metric in found.values())

    def test_unknown_fog_is_in_no_part(self) -> None:
        assert not any(metric.slice for metric in dehaze_metrics([scored(1.0, 0.1, None, 0)], []))


def test_the_shipped_recipe_brings_the_path_traced_pictures_nearer() -> None:
    folder = shared_data("rendered/fog")
    gains = []
    for pair in find_pairs(folder):
        hazy, clear = read_picture(pair.hazy).image, read_picture(pair.clear).image
        score = pair_score(hazy, dehazed(hazy, DehazeConfig()).image, clear)
        assert pair.fog_per_m is not None
        if pair.fog_per_m > 0.05:
            gains.append(score.psnr_after_db - score.psnr_before_db)
    assert len(gains) >= 5
    assert np.median(gains) > 1.0


def test_a_picture_by_itself_is_left_alone_or_dehazed() -> None:
    image = read_picture(FIXTURES / "stills/images/test/000010.jpg").image
    never = DehazeConfig(haze_on=1.0, haze_off=1.0)
    assert dehazed(image, never, when="auto").image is image
    changed = dehazed(image, never)
    assert changed.dehazed
    assert change_levels(image, changed.image) > 1.0
