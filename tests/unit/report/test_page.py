from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.plot_sink import PlotSink
from landtool.report.page import WIDTH_PX, draw_page
from landtool.report.page_data import DAMAGED, LOST, METHODS, PageData
from landtool.sink import SinkSetup
from landtool.types import FrameResult, Image, LostFrame
from tests.unit.report.landings import measured, result, track

WHITE = 250


def gathered(results: Iterable[FrameResult], lost: frozenset[int] = frozenset(), *, has_clock: bool = True) -> PageData:
    data = PageData(has_clock=has_clock)
    for one in results:
        data.add(one, lost=one.index in lost)
    return data


def drawn(data: PageData, title: str = "clip.mp4") -> Image:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # what the plotting library says lands on stderr
        png = draw_page(data, title=title)
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape[1] == WIDTH_PX
    return image.astype(np.uint8)


def pixels(image: Image, color: str) -> int:
    """How many pixels have a colour, #rrggbb."""
    blue, green, red = (int(color[i : i + 2], 16) for i in (5, 3, 1))
    return int((image == np.array([blue, green, red])).all(axis=2).sum())


def landing(count: int = 60) -> Iterator[FrameResult]:
    for i in range(count):
        method = "box" if i < count // 3 else "target" if i < 2 * count // 3 else "tag"
        stage = "far" if i < count // 2 else "near"
        status = "tentative" if i < 2 else "confirmed"
        one = track((0.0, 0.0), (0.05, 0.0), status, nis=None if i == 0 else 1.0 + i % 7, sigma_m=0.04)
        height_m = 12.0 - 11.0 * i / count
        yield measured(i, height_m, method, drone_m=(0.3, 0.0), stage=stage, altitude_m=height_m, tracks=(one,))


def test_series_hold_what_came() -> None:
    results = list(landing())
    results[10] = result(10, status="damaged", stage=None)
    results[11] = replace(results[11], status="damaged")
    data = gathered(results, frozenset({10}))
    trouble, method = data.frames.column("trouble"), data.frames.column("method")
    assert (trouble[9], trouble[10], trouble[11]) == (0.0, LOST, DAMAGED)
    assert np.isnan(method[10])
    assert (method[9], method[30], method[59]) == (METHODS["box"], METHODS["target"], METHODS["tag"])
    assert data.frames.column("distance_m")[0] == 12.0
    assert data.frames.column("lateral_m")[5] == pytest.approx(0.3)
    assert data.frames.column("at")[20] == pytest.approx(1.0)
    speed = data.frames.column("vx_mps")
    assert np.isnan(speed[:2]).all()  # tentative
    assert np.isfinite(speed[2:10]).all()
    assert data.residuals.column("x_m") == pytest.approx(0.05)
    assert data.residuals.column("sigma_m") == pytest.approx(0.04)


def test_a_page_shows_methods_stages_and_damage() -> None:
    plain = drawn(gathered(landing()))
    hurt = drawn(gathered(landing(), frozenset({30, 31})))
    for color in ("#0072b2", "#e69f00", "#cc79a7"):  # tag, target, box
        assert pixels(plain, color) > 100
    assert pixels(plain, "#cfe8f7") > 1000  # far
    assert pixels(plain, "#56b4e9") > 1000  # near
    assert pixels(hurt, "#222222") > pixels(plain, "#222222") + 200


def test_same_run_same_bytes() -> None:
    assert draw_page(gathered(landing()), title="a") == draw_page(gathered(landing()), title="a")


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_frames_and_none(count: int) -> None:
    drawn(gathered(landing(count)))


def test_nothing_measured_is_said() -> None:
    image = drawn(gathered([result(i) for i in range(5)]))
    assert (image < WHITE).any(axis=2).mean() < 0.03  # a sentence and a title, no panels
    assert (image[700:800] < WHITE).any()


def test_without_a_clock_frames_are_counted() -> None:
    data = gathered((replace(one, t_ns=None, tracks=()) for one in landing(8)), has_clock=False)
    assert data.frames.column("at").tolist() == list(range(8))
    drawn(data)


def test_a_lost_frame_without_a_time_has_no_place() -> None:
    data = gathered([*landing(4), result(4, t_ns=None, status="damaged", stage=None)], frozenset({4}))
    assert np.isnan(data.frames.column("at")[4])
    drawn(data)


def test_no_frame_has_a_time_in_a_recording_with_a_clock() -> None:
    drawn(gathered([replace(one, t_ns=None, tracks=()) for one in landing(3)]))


def test_time_that_steps_back() -> None:
    results = [*landing(30), *(replace(one, t_ns=(one.t_ns or 0) - 10**9) for one in landing(30))]
    drawn(gathered(results))


def test_ego_that_comes_and_goes_keeps_to_one_plane() -> None:
    results = [
        measured(0, 3.0, drone_m=(0.2, 0.0)),
        measured(1, 3.0, drone_m=None),
        measured(2, 3.0, drone_m=(0.2, 0.0)),
    ]
    data = gathered(results)
    assert data.reference == "world"
    assert np.isnan(data.frames.column("lateral_m")[1])


def test_strange_names_make_no_noise() -> None:
    drawn(gathered(landing(3)), title="着陸 $x_{1$ \udcff.mp4")


def test_the_sink_writes_the_page_when_all_is_well(tmp_path: Path) -> None:
    with PlotSink(SinkSetup(tmp_path, recording=Path("a/clip.mp4"))) as sink:
        for one in landing(5):
            sink.write(LostFrame(one.index, one.t_ns, "gone"), one)
    assert (tmp_path / "track.png").read_bytes()[:4] == b"\x89PNG"
    assert [path.name for path in tmp_path.iterdir()] == ["track.png"]
