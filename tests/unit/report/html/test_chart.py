"""Charts: what lies where, what is said where nothing is, and nothing that is no number."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from landtool.report.html.axis import Axis, span
from landtool.report.html.chart import Chart, Series, draw

AT = np.linspace(0.0, 10.0, 11)


def chart(*series: Series, **changes: object) -> Chart:
    return Chart("A <b> & c", "time, s", "error, m", series, **changes)  # type: ignore[arg-type]


def test_a_line_goes_up_where_its_values_do() -> None:
    drawn = draw(chart(Series("rising", AT, AT)))
    found = re.search(r'class="line s-a" d="([^"]+)"', str(drawn.svg))
    assert found
    points = [tuple(map(float, p.split())) for p in re.split("[ML]", found[1])[1:]]
    assert len(points) == len(AT)
    assert points == sorted(points, key=lambda p: p[0])
    assert [y for _, y in points] == sorted((y for _, y in points), reverse=True)


def test_an_unknown_value_breaks_the_line_and_is_an_empty_cell() -> None:
    y = AT.copy()
    y[5] = np.nan
    drawn = draw(chart(Series("broken", AT, y)))
    found = re.search(r'class="line s-a" d="([^"]+)"', str(drawn.svg))
    assert found
    assert found[1].count("M") == 2
    assert drawn.rows[5] == ("5", "")
    assert "nan" not in str(drawn).lower()


def test_a_band_is_cut_where_it_is_unknown() -> None:
    low = AT.copy()
    low[4] = np.nan
    drawn = draw(chart(Series("band", AT, low, "b", "band", AT + 1.0)))
    assert str(drawn.svg).count('class="band') == 2
    assert drawn.head == ("time, s", "band, from", "band, to")


@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize("y", [np.zeros(11), np.full(11, 3.0), -AT, AT * 1e-9, AT * 1e9, AT])
def test_every_chart_is_sound_xml_with_names_and_units(y: np.ndarray, log: bool) -> None:
    drawn = draw(chart(Series("x", AT, y, kind="marked"), log_y=log, timed=True, rule=(1.0, "limit")))
    root = ElementTree.fromstring(str(drawn.svg))
    assert root.attrib["role"] == "img"
    texts = [text for element in root.iter() for text in [element.text or ""] if text]
    assert {"time, s", "error, m"} <= set(texts)
    assert "A <b> & c" in texts[0]
    assert "nan" not in str(drawn.svg)
    assert "inf" not in str(drawn.svg)


def test_nothing_to_draw_is_said() -> None:
    drawn = draw(chart(Series("x", AT, np.full(11, np.nan)), empty="no pose: 0 of 0"))
    assert drawn.svg is None
    assert drawn.empty == "no pose: 0 of 0"


def test_equal_axes_have_one_scale() -> None:
    drawn = draw(chart(Series("way", AT, 0.1 * AT), equal=True, from_zero=False))
    found = re.search(r'class="line s-a" d="M(\S+) (\S+?)L.*?L(\S+) ([\d.]+)"', str(drawn.svg))
    assert found
    x0, y0 = float(found[1]), float(found[2])
    *_, (x1, y1) = [tuple(map(float, p.split())) for p in re.split("[ML]", found[0].split('d="')[1][:-1])[1:]]
    assert (y0 - y1) == pytest.approx(0.1 * (x1 - x0), abs=0.3)


def test_a_long_curve_is_thinned_and_its_table_says_so() -> None:
    x = np.arange(20_000, dtype=float)
    drawn = draw(chart(Series("long", x, np.sin(x))))
    assert len(str(drawn.svg)) < 20_000
    assert len(drawn.rows) == 24
    assert drawn.thinned.startswith("24 of 20000 points")


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-3.0, 17.0), (0.001, 0.0042), (1e5, 3e6)])
def test_ticks_are_few_round_and_inside(low: float, high: float) -> None:
    ticks = Axis(low, high, 0.0, 100.0).ticks()
    assert 3 <= len(ticks) <= 7
    assert all(low <= tick <= high for tick in ticks)


@pytest.mark.parametrize(("low", "high"), [(0.6, 20.0), (1.1, 1.9), (0.001, 300.0)])
def test_ticks_of_ratios_are_inside(low: float, high: float) -> None:
    ticks = Axis(low, high, 0.0, 100.0, log=True).ticks()
    assert 2 <= len(ticks) <= 20
    assert all(low <= tick <= high for tick in ticks)


def test_an_axis_of_nothing_is_one_all_the_same() -> None:
    assert span(np.array([])) == (0.0, 1.0)
    low, high = span(np.array([2.0]))
    assert low < 2.0 < high
    assert span(np.array([-1.0, 0.0]), log=True) == (1.0, 10.0)


@pytest.mark.parametrize("top", [1.0, 0.00042, 123456.0])
def test_the_numbers_of_an_axis_have_room(top: float) -> None:
    drawn = draw(chart(Series("small", AT, top * AT / 10.0)))
    ticks = re.findall(r'<text x="(\d+)" y="[^"]*" text-anchor="end">([^<]+)</text>', str(drawn.svg))
    assert len(ticks) > 2
    for right, text in ticks:
        assert int(right) == drawn.left - 6
        assert int(right) >= 8 * len(text)
