"""The report in a browser: it loads, plays, seeks, fits and can be read."""

from __future__ import annotations

import base64
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from landtool.io.video_stills import read_times
from landtool.report.html.write import write_report
from tests.unit.report.html.runs import GATE, landing, write_error_tables, write_evaluation, write_landing
from tests.unit.report.landings import FPS

SIZES = {"desktop": (1280, 900, False), "phone": (360, 740, True)}
# Contrast of every text with what is behind it, WCAG 2.2: (lighter + 0.05) / (darker + 0.05) of relative luminances
CONTRAST = """
const canvas = document.createElement("canvas").getContext("2d", {willReadFrequently: true});
const rgba = (text) => { canvas.clearRect(0, 0, 1, 1); canvas.fillStyle = text; canvas.fillRect(0, 0, 1, 1);
  return canvas.getImageData(0, 0, 1, 1).data; };
const light = (c) => { const l = [...c].slice(0, 3).map((v) => v / 255)
    .map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  return 0.2126 * l[0] + 0.7152 * l[1] + 0.0722 * l[2]; };
const behind = (e) => { for (; e; e = e.parentElement) { const c = rgba(getComputedStyle(e).backgroundColor);
    if (c[3] > 250) return c; } return rgba("white"); };
const found = [];
for (const e of document.querySelectorAll("body *")) {
  const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
  if (!own || !e.getClientRects().length || e.closest("script, style, title, .skip")) continue;
  const style = getComputedStyle(e);
  const [a, b] = [light(rgba(e.namespaceURI.endsWith("svg") ? style.fill : style.color)), light(behind(e))];
  const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  if (ratio < 4.5) found.push([ratio.toFixed(2), e.tagName, e.textContent.slice(0, 40)]);
}
return [document.querySelectorAll("body *").length, getComputedStyle(document.body).backgroundColor, found];
"""
# The grey level of the video's picture
SHOWN = """
const v = document.querySelector("video"), c = document.createElement("canvas").getContext("2d");
c.drawImage(v, 0, 0, 1, 1); return c.getImageData(0, 0, 1, 1).data[0];
"""
Page = Callable[..., Any]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("browser")


@pytest.fixture(scope="module")
def report(folder: Path) -> Path:
    """The page of a run of three seconds with a gap, its video embedded."""
    run = write_landing(folder / "run", landing(gap=range(30, 40)), name='a<b>&"ü着陸".mp4')
    write_report(run, folder / "report.html", video="embed")
    return folder / "report.html"


@pytest.fixture(scope="module")
def evaluation(folder: Path) -> Path:
    """The page of an evaluation, the video of its clip beside it."""
    made = write_evaluation(folder / "eval", gate=GATE)
    write_error_tables(made)
    write_landing(made / "runs" / "straight", landing())
    write_report(made, folder / "eval.html", video="link")
    return folder / "eval.html"


@pytest.fixture
def show(chromium: Any) -> Page:
    """Return a function that opens a page as a device of a size and scheme would, and the browser."""

    def open_page(path: Path, size: str = "desktop", scheme: str = "light") -> Any:
        width, height, mobile = SIZES[size]
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile}
        chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        for log in ("browser", "performance"):
            chromium.get_log(log)
        chromium.get(path.as_uri())
        return chromium

    return open_page


def wait(browser: Any, condition: str, seconds: float = 10.0) -> Any:
    """Wait until an expression of the page is true, and return it."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if value := browser.execute_script(f"return {condition}"):
            return value
        time.sleep(0.02)
    raise AssertionError(f"never true: {condition}")


def asked_for(browser: Any) -> list[str]:
    """Return the addresses of all requests since the page was opened."""
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    return [m["params"]["request"]["url"] for m in messages if m["method"] == "Network.requestWillBeSent"]


VIDEO = "document.querySelector('video')"
READY = f"{VIDEO}.readyState >= 2"


@pytest.mark.parametrize("which", ["report", "evaluation"])
def test_it_loads_without_errors_and_without_a_network(which: str, show: Page, request: pytest.FixtureRequest) -> None:
    browser = show(request.getfixturevalue(which))
    wait(browser, READY)
    urls = asked_for(browser)
    assert urls
    assert [url for url in urls if not url.startswith(("file:", "data:", "blob:"))] == []
    assert browser.get_log("browser") == []


@pytest.mark.parametrize("which", ["report", "evaluation"])
def test_the_video_plays_and_is_as_long_as_its_source(
    which: str, show: Page, request: pytest.FixtureRequest, folder: Path
) -> None:
    browser = show(request.getfixturevalue(which))
    wait(browser, READY)
    times = read_times(folder / "run" / "annotated.mp4")
    seconds = (times.end_ns - times.t_ns[0]) / 1e9
    assert browser.execute_script(f"return {VIDEO}.duration") == pytest.approx(seconds, abs=1 / FPS)
    browser.execute_script(f"{VIDEO}.play()")
    wait(browser, f"{VIDEO}.currentTime > 0.3")
    wait(browser, "Number(document.querySelector('.timeline').getAttribute('aria-valuenow')) > 0.3")
    wait(browser, f"{VIDEO}.ended")


def test_a_click_on_the_timeline_seeks_there(report: Path, show: Page) -> None:
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.by import By

    browser = show(report)
    wait(browser, READY)
    track = browser.find_element(By.CSS_SELECTOR, ".timeline .track")
    # from the middle of the element; the flight lasts 3 s
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", track)
    ActionChains(browser).move_to_element_with_offset(track, round(0.25 * track.size["width"]), 0).click().perform()
    wait(browser, f"!{VIDEO}.seeking && {VIDEO}.currentTime > 2")
    assert browser.execute_script(f"return {VIDEO}.currentTime") == pytest.approx(2.25, abs=1.01 / FPS)
    said = browser.find_element(By.CSS_SELECTOR, ".timeline").get_attribute("aria-valuetext")
    assert said.startswith(("2.20 s, frame 44, stage near", "2.25 s, frame 45, stage near"))
    assert "measured by tag, track confirmed" in said


def test_the_keyboard_steps_by_frames_and_seconds(report: Path, show: Page) -> None:
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    browser = show(report)
    wait(browser, READY)
    slider = browser.find_element(By.CSS_SELECTOR, ".timeline")
    assert slider.get_attribute("role") == "slider"

    for keys, expected in (
        ((Keys.ARROW_RIGHT, Keys.ARROW_RIGHT), 2 / FPS),
        ((Keys.ARROW_UP,), 1 + 2 / FPS),
        ((Keys.ARROW_LEFT,), 1 + 1 / FPS),
        ((Keys.END,), 59 / FPS),
        ((Keys.PAGE_DOWN,), 0.0),
        ((Keys.ARROW_UP, Keys.ARROW_UP, Keys.ARROW_DOWN), 1.0),
        ((Keys.HOME,), 0.0),
    ):
        slider.send_keys(*keys)
        wait(browser, f"!{VIDEO}.seeking && Math.abs({VIDEO}.currentTime - {expected}) < 0.002")
        assert float(slider.get_attribute("aria-valuenow")) == pytest.approx(expected, abs=1e-4)
    assert slider.get_attribute("aria-valuetext").startswith("0.00 s, frame 0, stage far")
    for key in (Keys.ENTER, Keys.SPACE):  # plays, pauses
        slider.send_keys(key)
        wait(browser, f"{VIDEO}.paused === {'false' if key == Keys.ENTER else 'true'}")


def test_what_is_shown_is_the_frame_that_was_asked_for(report: Path, show: Page) -> None:
    browser = show(report)
    wait(browser, READY)
    levels = []
    for i in (5, 20, 55):
        browser.execute_script(f"{VIDEO}.currentTime = {i / FPS} + 0.0005")
        wait(browser, f"!{VIDEO}.seeking")
        levels.append(browser.execute_script(SHOWN))
    assert levels == pytest.approx([20 + 2 * i for i in (5, 20, 55)], abs=3)


def test_a_video_that_starts_late_shows_the_frame_that_was_asked_for(folder: Path, show: Page) -> None:
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    run = write_landing(folder / "late", landing(), start_ns=700_000_000)
    write_report(run, folder / "late.html", video="embed")
    browser = show(folder / "late.html")
    wait(browser, READY)
    slider = browser.find_element(By.CSS_SELECTOR, ".timeline")
    for keys, frame in (((Keys.END,), 59), ((Keys.HOME,), 0), ((Keys.ARROW_UP, Keys.ARROW_RIGHT), 21)):
        slider.send_keys(*keys)
        wait(browser, f"!{VIDEO}.seeking && Math.abs({VIDEO}.currentTime - {0.7 + frame / FPS}) < 0.002")
        assert browser.execute_script(SHOWN) == pytest.approx(20 + 2 * frame, abs=3)
        assert f"frame {frame}, " in slider.get_attribute("aria-valuetext")


def test_a_worst_frame_and_a_chart_seek_too(report: Path, show: Page) -> None:
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.by import By

    browser = show(report)
    wait(browser, READY)
    button = browser.find_elements(By.CSS_SELECTOR, "#worst button")[-1]
    wanted = float(button.get_attribute("data-at"))
    assert wanted > 0.5
    browser.execute_script("arguments[0].click()", button)
    wait(browser, f"!{VIDEO}.seeking && {VIDEO}.currentTime > 0.5")
    assert browser.execute_script(f"return {VIDEO}.currentTime") == pytest.approx(wanted, abs=0.002)
    chart = browser.find_element(By.CSS_SELECTOR, ".plot[data-player] svg")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", chart)
    left, right = (
        float(browser.execute_script(f"return document.querySelector('.plot').dataset.{n}")) for n in ("left", "right")
    )
    # the middle of the plot, seen from the middle of the picture, 380 units wide
    off = ((left + right) / 2 - 190) / 380 * chart.size["width"]
    ActionChains(browser).move_to_element_with_offset(chart, round(off), 0).click().perform()
    middle = 59 / FPS / 2
    wait(browser, f"!{VIDEO}.seeking && Math.abs({VIDEO}.currentTime - {middle}) < 0.1")


@pytest.mark.parametrize("which", ["report", "evaluation"])
def test_nothing_sticks_out_of_a_phone(which: str, show: Page, request: pytest.FixtureRequest) -> None:
    browser = show(request.getfixturevalue(which), "phone")
    browser.execute_script("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    root = "document.documentElement"
    assert browser.execute_script(f"return [{root}.clientWidth, {root}.scrollWidth]") == [360, 360]
    smallest = browser.execute_script(
        "return Math.min(...[...document.querySelectorAll('.plot svg')].map((s) =>"
        " 12.5 * s.getBoundingClientRect().width / s.viewBox.baseVal.width))"
    )
    assert smallest >= 9.0  # CSS pixels of a chart's letters


@pytest.mark.parametrize("size", ["desktop", "phone"])
def test_the_main_tables_need_no_scrolling(size: str, evaluation: Path, show: Page) -> None:
    browser = show(evaluation, size)
    browser.execute_script("document.querySelectorAll('#gate details').forEach((d) => { d.open = true; })")
    wide = browser.execute_script(
        "return [...document.querySelectorAll('#gate .scroll, .tables .scroll')]"
        ".map((s) => [s.getAttribute('aria-label'), s.clientWidth, s.scrollWidth])"
    )
    assert [name for name, _, _ in wide] == ["Gate: what is not the same", "The same: 1", "In short"]
    assert all(inside >= needed for _, inside, needed in wide)
    whole = browser.execute_script("return document.querySelector('#numbers').clientWidth")
    assert min(inside for _, inside, _ in wide) == whole
    worse = browser.execute_script("return document.querySelector('#gate .row-bad').innerText")
    assert all(word in worse for word in ("detection.map50", "0.95", "0.7", "0.25", "worse"))


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("which", ["report", "evaluation"])
def test_every_text_has_contrast(which: str, scheme: str, show: Page, request: pytest.FixtureRequest) -> None:
    browser = show(request.getfixturevalue(which), scheme=scheme)
    browser.execute_script("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    count, paper, low = browser.execute_script(CONTRAST)
    assert count > 300
    assert (sum(map(int, paper[4:-1].split(","))) < 150) == (scheme == "dark")
    assert low == []


def test_every_control_can_be_reached_and_has_a_name(report: Path, show: Page) -> None:
    browser = show(report)
    tree = browser.execute_cdp_cmd("Accessibility.getFullAXTree", {})["nodes"]
    controls = [n for n in tree if n.get("role", {}).get("value") in ("button", "link", "slider", "image", "img")]
    assert len(controls) > 10
    assert [n["role"]["value"] for n in controls if not n["ignored"] and not n.get("name", {}).get("value")] == []


def test_it_prints(report: Path, show: Page) -> None:
    browser = show(report, scheme="dark")
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})
    pdf = base64.b64decode(browser.print_page())
    assert pdf.startswith(b"%PDF")
    pdfium = pytest.importorskip("pypdfium2")
    with pdfium.PdfDocument(pdf) as document:
        words = " ".join(" ".join(page.get_textpage().get_text_bounded() for page in document).split())
        assert 2 <= len(document) <= 12
    assert "Tracked, with gaps" in words
    assert "Worst frames" in words
