"""Recordings through `dehaze` with a stage that is foreseen: kinds, timing, what stays and what is refused."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image as PilImage

from landtool.config import DehazeCommandConfig
from landtool.dehaze.config import DehazeConfig
from landtool.dehaze.stage import Dehazed
from landtool.errors import InputError, OutputExistsError, UsageError
from landtool.io.image_out import IMAGE_FORMATS
from landtool.io.mcap_out import McapImageWriter
from landtool.io.source import open_source
from landtool.run import dehazing
from landtool.run.dehazed_files import dehazed_paths
from landtool.run.recording import RunOutcome
from landtool.types import Frame, Image
from tests.conftest import HEIGHT, WIDTH, ClipMaker, picture, pictured

PTS = (0, 512, 1100, 1536, 5000, 5120)
TICK = Fraction(1, 15360)
DEHAZED = {1, 2, 5}


class Foreseen:
    """Inverts the frames of `DEHAZED`, with a transmission of a quarter of the size; the others pass."""

    def __init__(self, config: DehazeConfig, *, when: str) -> None:
        self.config, self.when = config, when

    def see(self, frame: Frame) -> Dehazed:
        if frame.index not in DEHAZED and self.when == "auto":
            return Dehazed(frame.image, 0.1, False, None)
        share = np.full((-(-frame.image.shape[0] // 4), -(-frame.image.shape[1] // 4)), 0.5, np.float32)
        return Dehazed(np.asarray(255 - frame.image, np.uint8), 0.1 * frame.index, True, share)


@pytest.fixture(autouse=True)
def _foreseen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dehazing, "DehazeStage", Foreseen)


def run(path: Path, output: Path, *, overwrite: bool = False, **settings: object) -> RunOutcome:
    return dehazing.dehaze(path, output, DehazeCommandConfig(**settings), overwrite=overwrite)  # type: ignore[arg-type]


def seen(path: Path) -> list[Frame]:
    return [frame for frame in open_source(path) if isinstance(frame, Frame)]


def read(path: Path) -> Image:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return np.asarray(image)


def shots(folder: Path, names: Sequence[str] = ("a.png", "b.png", "c.jpg", "d.jpg", "e.webp", "f.tif")) -> Path:
    folder.mkdir()
    for index, name in enumerate(names):
        assert cv2.imwrite(str(folder / name), picture(index))
    return folder


# --- kinds


@pytest.mark.parametrize("suffix", [".mp4", ".mov"])
def test_a_video_keeps_its_times(make_clip: ClipMaker, tmp_path: Path, suffix: str) -> None:
    clip, out = make_clip("a.mkv" if suffix == ".mov" else "a.mp4", PTS), tmp_path / f"out{suffix}"
    outcome = run(clip, out)
    assert outcome.exit_code == 0
    assert outcome.folder == out
    before, after = seen(clip), seen(out)
    assert [f.t_ns for f in after] == [f.t_ns for f in before]
    for was, now in zip(before, after, strict=True):
        wanted = 255 - was.image.astype(int) if was.index in DEHAZED else was.image.astype(int)
        assert np.abs(now.image - wanted).mean() < 12.0
    assert outcome.summary.lines() == ["frames 6, dehazed 3 (50.0%)", "haze 0.10 in the median, 0.10 to 0.50"]


def test_a_video_side_by_side_is_twice_as_wide(make_clip: ClipMaker, tmp_path: Path) -> None:
    run(make_clip("a.mp4", PTS), tmp_path / "out.mp4", side_by_side=True, when="on")
    after = seen(tmp_path / "out.mp4")
    assert {f.image.shape for f in after} == {(HEIGHT, 2 * WIDTH, 3)}
    assert [pictured(f.image[:, :WIDTH]) for f in after] == list(range(6))
    assert np.abs(255 - after[0].image[:, :WIDTH].astype(int) - after[0].image[:, WIDTH:]).mean() < 12.0


def test_a_folder_stays_a_folder_and_clear_files_their_bytes(tmp_path: Path) -> None:
    source = shots(tmp_path / "in")
    outcome = run(source, tmp_path / "out")
    assert outcome.exit_code == 0
    names = sorted(path.name for path in source.iterdir())
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names
    for index, name in enumerate(names):
        before, after = source / name, tmp_path / "out" / name
        assert (before.read_bytes() == after.read_bytes()) == (index not in DEHAZED)
        assert read(after).shape == read(before).shape
    assert np.array_equal(read(tmp_path / "out/b.png"), 255 - picture(1))
    assert np.abs(read(tmp_path / "out/c.jpg").astype(int) - (255 - read(source / "c.jpg"))).mean() < 10.0


@pytest.mark.parametrize("suffix", list(IMAGE_FORMATS))
@pytest.mark.parametrize("when", ["auto", "on"])
def test_an_image_is_written_as_its_output_says(tmp_path: Path, suffix: str, when: str) -> None:
    cv2.imwrite(str(tmp_path / "in.png"), picture(0))
    run(tmp_path / "in.png", tmp_path / f"out{suffix}", when=when)
    wanted = picture(0) if when == "auto" else 255 - picture(0)
    (after,) = seen(tmp_path / f"out{suffix}")
    assert after.image.shape == wanted.shape
    assert IMAGE_FORMATS[suffix] == "jpeg" or np.array_equal(after.image, wanted)
    if (suffix, when) == (".png", "auto"):
        assert (tmp_path / "out.png").read_bytes() == (tmp_path / "in.png").read_bytes()


def test_grey_stays_grey_and_what_is_dropped_is_said(tmp_path: Path) -> None:
    source = tmp_path / "in"
    source.mkdir()
    for name, mode in (("a.png", "L"), ("b.png", "I;16"), ("c.png", "RGBA"), ("d.png", "LA")):
        PilImage.new(mode, (12, 8)).save(source / name)
    outcome = run(source, tmp_path / "out", when="on")
    shapes = [read(tmp_path / "out" / name).shape for name in ("a.png", "b.png", "c.png", "d.png")]
    assert shapes == [(8, 12), (8, 12), (8, 12, 3), (8, 12)]
    assert outcome.notes == (
        "1 pictures of 16 bits a channel were written with 8",
        "2 pictures were written without their alpha channel",
    )


@pytest.mark.parametrize("size", [(1, 1), (2000, 3), (3, 2000)])
def test_odd_sizes_of_images_stay(tmp_path: Path, size: tuple[int, int]) -> None:
    cv2.imwrite(str(tmp_path / "in.png"), np.full((*size, 3), 90, np.uint8))
    run(tmp_path / "in.png", tmp_path / "out.png", when="on", save_transmission=True)
    assert np.array_equal(read(tmp_path / "out.png"), np.full((*size, 3), 165, np.uint8))
    assert read(tmp_path / "out-transmission/in.png").shape == size


def test_a_log_keeps_its_stamps_and_clear_messages(tmp_path: Path) -> None:
    with McapImageWriter(
        tmp_path / "a.mcap", schema="ros2", topic="/cam/image", frame_id="cam", camera=None, encoding="raw"
    ) as log:
        for index in range(6):
            log.write(Frame(index, 1_000_000_000 + PTS[index], picture(index)))
    outcome = run(tmp_path / "a.mcap", tmp_path / "b.mcap", save_transmission=True)
    assert (outcome.exit_code, outcome.notes) == (0, tuple(open_source(tmp_path / "a.mcap").info.notes))
    after = seen(tmp_path / "b.mcap")
    assert [f.t_ns for f in after] == [1_000_000_000 + tick for tick in PTS]
    for index, frame in enumerate(after):
        assert np.array_equal(frame.image, 255 - picture(index) if index in DEHAZED else picture(index))
    maps = sorted(path.name for path in (tmp_path / "b-transmission").iterdir())
    assert maps == [f"{index:06d}.png" for index in sorted(DEHAZED)]


def test_a_log_is_not_written_side_by_side(tmp_path: Path) -> None:
    with McapImageWriter(
        tmp_path / "a.mcap", schema="ros2", topic="/cam/image", frame_id="cam", camera=None, encoding="png"
    ) as log:
        log.write(Frame(0, 5, picture(0)))
    with pytest.raises(UsageError, match="would not fit the calibration in a log; leave out --side-by-side"):
        run(tmp_path / "a.mcap", tmp_path / "b.mcap", side_by_side=True)
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


# --- transmission


def test_maps_are_of_dehazed_frames_and_full_size(make_clip: ClipMaker, tmp_path: Path) -> None:
    outcome = run(make_clip("a.mp4", PTS), tmp_path / "out.mp4", save_transmission=True)
    folder = tmp_path / "out-transmission"
    assert sorted(path.name for path in folder.iterdir()) == ["000001.png", "000002.png", "000005.png"]
    share = read(folder / "000001.png")
    assert (share.shape, share.dtype) == ((HEIGHT, WIDTH), np.uint16)
    assert set(share.ravel()) == {32768}
    assert outcome.summary.lines()[-1] == f"transmission maps in {folder}"


def test_maps_of_images_have_their_names(tmp_path: Path) -> None:
    source = shots(tmp_path / "in", ("a.png", "b.jpg", "b.png"))
    run(source, tmp_path / "out", save_transmission=True)
    names = sorted(path.name for path in (tmp_path / "out-transmission").iterdir())
    assert names == ["b.png", "b.png.png"]


def test_overwriting_replaces_only_what_could_be_its_own(make_clip: ClipMaker, tmp_path: Path) -> None:
    clip, source = make_clip("a.mp4", PTS), shots(tmp_path / "in")
    for path, out in ((clip, tmp_path / "out.mp4"), (source, tmp_path / "out")):
        run(path, out, save_transmission=True)
        with pytest.raises(OutputExistsError):
            run(path, out, save_transmission=True)
        before = {p: p.read_bytes() for p in tmp_path.glob("out*/*")}
        run(path, out, save_transmission=True, overwrite=True, when="on")
        assert {p: p.read_bytes() for p in tmp_path.glob("out*/*")} != before
        (tmp_path / "out-transmission/letter.txt").write_text("mine")
        with pytest.raises(UsageError, match="holds files landtool did not write"):
            run(path, out, save_transmission=True, overwrite=True)
        for item in (tmp_path / "out-transmission").iterdir():
            item.unlink()


# --- loss


def test_a_picture_that_is_broken_is_left_out_and_counted(tmp_path: Path) -> None:
    source = shots(tmp_path / "in")
    (source / "b.png").write_bytes(b"\x89PNG\r\n\x1a\nnothing")
    outcome = run(source, tmp_path / "out")
    assert (outcome.exit_code, outcome.counts.lost, outcome.summary.frames) == (3, 1, 6)
    assert not (tmp_path / "out/b.png").exists()
    assert len(list((tmp_path / "out").iterdir())) == 5


def test_images_of_several_sizes_keep_theirs(tmp_path: Path) -> None:
    source = tmp_path / "in"
    source.mkdir()
    for index, side in enumerate((16, 24)):
        cv2.imwrite(str(source / f"{index}.png"), np.full((side, side, 3), 9, np.uint8))
    run(source, tmp_path / "out", when="on")
    assert [read(tmp_path / f"out/{index}.png").shape[0] for index in range(2)] == [16, 24]


def test_nothing_is_left_of_a_run_that_fails(
    make_clip: ClipMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clip = make_clip("a.mp4", PTS)
    clip.write_bytes(b"no video, only text")
    with pytest.raises(InputError):
        run(clip, tmp_path / "out.mp4", save_transmission=True)

    def fail(_self: Foreseen, frame: Frame) -> Dehazed:
        raise InputError(f"frame {frame.index}")

    good = make_clip("b.mp4", PTS)
    monkeypatch.setattr(Foreseen, "see", fail)
    with pytest.raises(InputError, match="frame 0"):
        run(good, tmp_path / "out.mp4", save_transmission=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mp4", "b.mp4"]


# --- names


@pytest.fixture
def named(make_clip: ClipMaker, tmp_path: Path) -> Path:
    make_clip("a.mp4", PTS)
    make_clip("a.mkv", PTS)
    shots(tmp_path / "in", ("x.png",))
    return tmp_path


def test_outputs_are_named(named: Path) -> None:
    a, mkv, folder, image = named / "a.mp4", named / "a.mkv", named / "in", named / "in/x.png"
    out = named / "out"
    assert dehazed_paths([a], named / "b.mov", overwrite=False) == [named / "b.mov"]
    assert dehazed_paths([folder], out, overwrite=False) == [out]
    assert dehazed_paths([mkv, folder, image], out, overwrite=False) == [out / "a.mp4", out / "in", out / "x.png"]
    out.mkdir()
    assert dehazed_paths([mkv], out, overwrite=False) == [out / "a.mp4"]
    assert dehazed_paths([folder], out, overwrite=False) == [out]
    assert dehazed_paths([a, named / "absent.mp4"], out, overwrite=False) == [out / "a.mp4", out / "absent.mp4"]


@pytest.mark.parametrize(
    ("inputs", "output", "said"),
    [
        (["a.mp4"], "b.avi", "a video cannot be written to the ending '.avi'; use one of .mp4 .m4v .mov"),
        (["a.mp4"], "b.png", "a video cannot be written to the ending '.png'"),
        (["a.mp4"], "b", "a video cannot be written to a name without an ending"),
        (["in/x.png"], "x.gif", "an image cannot be written to the ending '.gif'; use one of .png .jpg"),
        (["in"], "in.mp4", "is the name of a file, and a folder of images becomes a folder; name a folder with -o"),
        (["a.mp4"], "a.mp4", "is the input itself, which is never changed"),
        (["in"], "in/out", "lies in the input"),
        (["a.mp4", "in"], ".", "is the input itself"),
        (["a.mp4", "a.mkv"], "out", "would write the same as "),
        (["a.mp4", "in"], "a.mkv", "is no folder, and there are several inputs"),
        (["a.mp4"], "a.mkv", "a video cannot be written to the ending '.mkv'"),
        (["absent.mp4"], "b.mp4", "does not exist"),
    ],
)
def test_outputs_that_cannot_be_are_refused(named: Path, inputs: list[str], output: str, said: str) -> None:
    with pytest.raises(UsageError) as caught:
        dehazed_paths([named / name for name in inputs], named / output, overwrite=True)
    assert said in str(caught.value)


def test_outputs_that_are_there_are_refused(named: Path) -> None:
    (named / "b.mp4").write_text("mine")
    (named / "c-transmission").mkdir()
    dehazed_paths([named / "a.mp4"], named / "c.mp4", overwrite=False, maps=True)
    (named / "c-transmission/x").write_text("mine")
    for output in ("b.mp4", "c.mp4"):
        with pytest.raises(OutputExistsError):
            dehazed_paths([named / "a.mp4"], named / output, overwrite=False, maps=True)
