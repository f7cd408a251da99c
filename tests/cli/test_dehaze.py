"""`landtool dehaze`: what it writes, says and returns, and what it refuses."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader

from landtool.io.source import open_source
from landtool.types import Frame
from landtool_cli.main import run
from tests.cli.conftest import Told
from tests.cli.landing import CAMERA, EPOCH_NS, TIMES_NS, Landing, cut, snapshot, zeroed

COUNT = len(TIMES_NS)
NEVER = ("--haze-on", "1", "--haze-off", "1")
Dehaze = Callable[..., Told]


@pytest.fixture
def dehaze(here: Path, capfd: pytest.CaptureFixture[str]) -> Dehaze:  # noqa: ARG001 - called in `here`
    """Return a function that calls `landtool dehaze` in a folder with clip.mp4."""

    def call(*args: str) -> Told:
        capfd.readouterr()
        code = run(["dehaze", *args])
        return Told(code, *capfd.readouterr())

    return call


def frames(path: str | Path) -> list[Frame]:
    return [frame for frame in open_source(path) if isinstance(frame, Frame)]


def messages(path: str | Path) -> list[tuple[object, ...]]:
    with Path(path).open("rb") as file:
        found = make_reader(file).iter_messages(log_time_order=False)
        return [(c.topic, s.name if s else "", m.log_time, m.publish_time, m.sequence, m.data) for s, c, m in found]


def test_a_video_keeps_kind_size_and_times(dehaze: Dehaze, here: Path) -> None:
    before = snapshot(here)
    told = dehaze("clip.mp4", "-o", "clear.mp4", "--when", "on")
    assert (told.code, told.err) == (0, "")
    lines = told.out.splitlines()
    assert lines[:2] == ["clip.mp4: clear.mp4", f"  frames {COUNT}, dehazed {COUNT} (100.0%)"]
    assert re.fullmatch(r"  haze 0\.\d\d in the median, 0\.\d\d to [01]\.\d\d", lines[2])
    assert re.fullmatch(r"  \d+ frames/s over \d+\.\d s", lines[3])
    after = frames("clear.mp4")
    assert [frame.t_ns for frame in after] == list(TIMES_NS)
    assert {frame.image.shape for frame in after} == {(CAMERA.height, CAMERA.width, 3)}
    assert snapshot(here, without=["clear.mp4"]) == before


def test_a_clear_frame_passes_unchanged(dehaze: Dehaze, landing: Landing, here: Path) -> None:
    landing.images(here / "shots")
    landing.log(here / "flight.mcap")
    told = dehaze("shots", "flight.mcap", "-o", "out", *NEVER)
    assert told.code == 0
    assert "  frames 4, dehazed 0 (0.0%)" in told.out
    assert snapshot(here / "out/shots") == snapshot(here / "shots")
    assert messages("out/flight.mcap") == messages("flight.mcap")


@pytest.mark.parametrize("recipe", ["veil", "paper"])
def test_every_kind_with_every_recipe(dehaze: Dehaze, landing: Landing, here: Path, recipe: str) -> None:
    landing.images(here / "shots")
    landing.log(here / "flight.mcap")
    shutil.copy("shots/img0.png", "one.png")
    told = dehaze("clip.mp4", "shots", "flight.mcap", "one.png", "-o", "out", "--when", "on", "--recipe", recipe)
    assert told.code == 0, told.err
    assert sorted(path.name for path in (here / "out").iterdir()) == ["clip.mp4", "flight.mcap", "one.png", "shots"]
    log = frames("out/flight.mcap")
    assert [frame.t_ns for frame in log] == [EPOCH_NS + t_ns for t_ns in TIMES_NS]
    changed = [(a.image != b).any() for a, b in zip(log, landing.pictures, strict=True)]
    assert all(changed)
    same = [a == b for a, b in zip(messages("flight.mcap"), messages("out/flight.mcap"), strict=True)]
    topics = [message[0] for message in messages("flight.mcap")]
    assert same == [topic != "/camera/image_raw" for topic in topics]
    for path in ("out/one.png", "out/shots/img0.png"):
        image = cv2.imread(path)
        assert image is not None
        assert image.shape == landing.pictures[0].shape


def test_side_by_side_and_transmission(dehaze: Dehaze, landing: Landing, here: Path) -> None:
    landing.images(here / "shots", 2)
    told = dehaze("shots", "-o", "out", "--when", "on", "--side-by-side", "--save-transmission")
    assert told.code == 0
    assert "  transmission maps in out-transmission\n" in told.out
    image = cv2.imread("out/img1.png")
    assert image is not None
    assert image.shape == (CAMERA.height, 2 * CAMERA.width, 3)
    assert np.array_equal(image[:, : CAMERA.width], landing.pictures[1])
    assert sorted(path.name for path in (here / "out-transmission").iterdir()) == ["img0.png", "img1.png"]
    share = cv2.imread("out-transmission/img1.png", cv2.IMREAD_UNCHANGED)
    assert share is not None
    assert (share.dtype, share.shape) == (np.uint16, (CAMERA.height, CAMERA.width))
    assert share.min() > 0


def test_rotation_is_applied(dehaze: Dehaze, landing: Landing, here: Path) -> None:
    landing.remuxed(here / "turned.mp4", rotation_deg=90)
    assert dehaze("turned.mp4", "-o", "clear.mp4", *NEVER).code == 0
    after = frames("clear.mp4")
    assert [frame.t_ns for frame in after] == list(TIMES_NS)
    assert np.abs(after[0].image.astype(int) - landing.pictures[0]).mean() < 6.0


def test_a_file_sets_what_options_do_not(dehaze: Dehaze, here: Path) -> None:
    (here / "paper.toml").write_text('when = "on"\n[dehazer]\nrecipe = "paper"\n[dehazer.paper]\nomega = 0.0\n')
    cv2.imwrite("in.png", np.random.default_rng(5).integers(60, 200, (40, 60, 3), np.uint8))
    assert dehaze("in.png", "-o", "same.png", "--config", "paper.toml").code == 0
    assert dehaze("in.png", "-o", "other.png", "--config", "paper.toml", "--omega", "0.9").code == 0
    read = [np.asarray(cv2.imread(name), int) for name in ("in.png", "same.png", "other.png")]
    assert np.abs(read[1] - read[0]).max() <= 1
    assert np.abs(read[2] - read[0]).max() > 5
    told = dehaze("in.png", "-o", "paper.toml", "--config", "paper.toml", "--overwrite")
    assert (told.code, len(told.lines)) == (2, 1)


# --- loss


def test_a_truncated_video_is_written_up_to_its_end(dehaze: Dehaze, landing: Landing, here: Path) -> None:
    landing.remuxed(here / "cut.mp4", {"movflags": "frag_keyframe+empty_moov"})
    cut(here / "cut.mp4", 0.6)
    told = dehaze("cut.mp4", "-o", "clear.mp4", "--when", "on")
    assert told.code == 3
    assert told.lines
    after = frames("clear.mp4")
    assert 0 < len(after) < COUNT
    assert [frame.t_ns for frame in after] == list(TIMES_NS[: len(after)])


def test_a_damaged_video_is_counted(dehaze: Dehaze, landing: Landing, here: Path) -> None:
    zeroed(landing.video(here / "bad.mp4", times=3), 0.4, 0.05)
    told = dehaze("bad.mp4", "-o", "clear.mp4", "--when", "on")
    assert told.code == 3
    assert re.search(rf"bad\.mp4: damaged \d+, lost \d+, of {3 * COUNT}", told.err)
    times = {frame.t_ns for frame in frames("bad.mp4")}
    assert {frame.t_ns for frame in frames("clear.mp4")} == times


def test_one_input_that_fails_does_not_cost_the_others(dehaze: Dehaze, here: Path) -> None:
    (here / "text.mp4").write_text("no video")
    told = dehaze("text.mp4", "absent.mp4", "clip.mp4", "-o", "out", "--when", "on")
    assert told.code == 3
    assert len(told.lines) == 2
    assert [path.name for path in (here / "out").iterdir()] == ["clip.mp4"]


# --- what is refused


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (("clip.mp4",), "missing option '-o' / '--output'"),
        (("-o", "clear.mp4"), "missing argument 'INPUT...'"),
        (("clop.mp4", "-o", "clear.mp4"), "clop.mp4: does not exist; did you mean clip.mp4?"),
        (("clip.mp4", "-o", "clip.mp4"), "clip.mp4: is the input itself, which is never changed"),
        (("clip.mp4", "-o", "clip.mp4", "--overwrite"), "clip.mp4: is the input itself"),
        (("clip.mp4", "-o", "clear.gif"), "clear.gif: a video cannot be written to the ending '.gif'"),
        (("shots", "-o", "clear.mp4"), "clear.mp4: is the name of a file, and a folder of images becomes a folder"),
        (("clip.mp4", "-o", "taken.mp4"), "taken.mp4: exists already"),
        (("clip.mp4", "other/clip.mp4", "-o", "out"), "would write the same as clip.mp4"),
        (("clip.mp4", "-o", "c.mp4", "--recipe", "paper", "--omega", "1.5"), "1.5 is not in the range"),
        (("clip.mp4", "-o", "c.mp4", "--recipe", "paper", "--t0", "0"), "0.0 is not in the range"),
        (("clip.mp4", "-o", "c.mp4", "--recipe", "paper", "--t0", "nan"), "nan is not in the range"),
        (("clip.mp4", "-o", "c.mp4", "--recipe", "paper", "--patch", "4"), "patch_px = 4 has no middle"),
        (("clip.mp4", "-o", "c.mp4", "--omega", "0.9"), "--omega is read only with --recipe paper; add --recipe paper"),
        (("clip.mp4", "-o", "c.mp4", "--guided-radius", "9"), "--guided-radius is read only with --recipe paper"),
        (
            ("clip.mp4", "-o", "c.mp4", "--recipe", "paper", "--matting-lambda", "0.1"),
            "--matting-lambda is read only with --refine matting",
        ),
        (("clip.mp4", "-o", "c.mp4", "--haze-on", "0.05"), "haze_off = 0.09 is above haze_on = 0.05"),
        (("clip.mp4", "-o", "c.mp4", "--tone", "log"), "tone"),
        (("clip.mp4", "-o", "c.mp4", "--topic", "/cam"), "has no topics, only an MCAP log has"),
        (("clip.mp4", "-o", "c.mp4", "--fps", "30"), "has its own clock"),
        (("flight.mcap", "-o", "c.mcap", "--side-by-side"), "would not fit the calibration in a log"),
    ],
)  # fmt: skip
def test_what_is_refused(dehaze: Dehaze, landing: Landing, here: Path, args: tuple[str, ...], said: str) -> None:
    landing.images(here / "shots", 1)
    landing.log(here / "flight.mcap")
    (here / "other").mkdir()
    shutil.copy("clip.mp4", "other")
    (here / "taken.mp4").write_text("mine")
    before = snapshot(here)
    told = dehaze(*args)
    assert (told.code, told.out, len(told.lines)) == (2, "", 1)
    assert said in told.err
    assert snapshot(here) == before


def test_an_output_is_replaced_when_asked(dehaze: Dehaze, landing: Landing, here: Path) -> None:
    landing.images(here / "shots", 2)
    (here / "clear.mp4").write_text("old")
    assert dehaze("clip.mp4", "-o", "clear.mp4", "--overwrite").code == 0
    assert len(frames("clear.mp4")) == COUNT
    for options in ((), ("--overwrite",)):
        assert dehaze("shots", "-o", "out", *options).code == 0
    (here / "out/letter.txt").write_text("mine")
    told = dehaze("shots", "-o", "out", "--overwrite")
    assert told.code == 2
    assert "holds files landtool did not write" in told.err


def test_no_maps_are_told_where_nothing_is_dehazed(dehaze: Dehaze) -> None:
    told = dehaze("clip.mp4", "-o", "same.mp4", "--save-transmission", *NEVER)
    assert told.code == 0
    assert "  no transmission maps" in told.out.splitlines()


def test_unreadable_pictures_are_named(dehaze: Dehaze, here: Path) -> None:
    (here / "photos").mkdir()
    cv2.imwrite(str(here / "photos/a.png"), np.full((40, 60, 3), 90, np.uint8))
    for number in range(7):
        (here / f"photos/torn{number}.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    told = dehaze("photos", "-o", "clear")
    assert told.code == 3
    assert "not read: torn0.png, torn1.png, torn2.png, torn3.png, torn4.png and others" in told.err
