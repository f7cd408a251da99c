"""What every sink promises, one body over all of them."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from landtool.errors import OutputError, OutputExistsError, UsageError
from landtool.io.tables import TABLES, read_table
from landtool.plot_sink import PlotSink
from landtool.results_log.sink import McapSink
from landtool.sink import Sink, SinkSetup
from landtool.sinks import SINKS, CsvSink, ImagesSink, VideoSink, open_sinks, write_all
from landtool.tum_sink import TumSink
from landtool.types import Frame, FrameResult, LostFrame

STEP_NS = 40_000_000
SIZE = (96, 64)
Make = Callable[[SinkSetup], Sink]
# every sink, and what it leaves in its folder when all is well
KINDS: dict[str, tuple[Make, set[str]]] = {
    "csv": (CsvSink, set(TABLES)),
    "video": (VideoSink, {"annotated.mp4"}),
    "images": (ImagesSink, {"annotated"}),
    "mcap": (McapSink, {"track.mcap"}),
    "tum": (TumSink, {"pad_in_camera.tum"}),
    "plot": (PlotSink, {"track.png"}),
}


@pytest.fixture(params=sorted(KINDS))
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def setup_in(folder: Path) -> SinkSetup:
    return SinkSetup(folder, time_base=Fraction(1, 1000))


def stream(count: int = 4, lost: int = 1, damaged: int = 2) -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
    width, height = SIZE
    for i in range(count):
        t_ns = i * STEP_NS
        if i == lost:
            yield LostFrame(i, t_ns, "no picture"), FrameResult(i, t_ns, status="damaged", reason="no picture")
            continue
        damage = "concealed" if i == damaged else ""
        frame = Frame(i, t_ns, np.full((height, width, 3), 40 * i, np.uint8), file=f"p{i}.png", damage=damage)
        yield frame, FrameResult(i, t_ns, file=frame.file, status=frame.status, stage_seconds={"tags": 0.25})


def write(make: Make, folder: Path, results: Iterator[tuple[Frame | LostFrame, FrameResult]]) -> None:
    with make(setup_in(folder)) as sink:
        write_all(results, [sink])


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()} if folder.exists() else set()


def open_files() -> set[str]:
    return {os.path.realpath(f"/proc/self/fd/{fd}") for fd in os.listdir("/proc/self/fd")}  # noqa: PTH208


def test_appears_at_the_end_with_damaged_and_lost_frames(kind: str, tmp_path: Path) -> None:
    make, outputs = KINDS[kind]
    folder = tmp_path / "run"
    with make(setup_in(folder)) as sink:
        write_all(stream(), [sink])
        assert not {name for name in names(folder) if not name.startswith(".landtool-")}
    assert names(folder) == outputs
    assert sink.notes == []


@pytest.mark.parametrize("error", [RuntimeError("boom"), KeyboardInterrupt()])
@pytest.mark.parametrize("after", [0, 3])
def test_an_exception_leaves_nothing(kind: str, tmp_path: Path, error: BaseException, after: int) -> None:
    def failing() -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
        yield from stream(after)
        raise error

    with pytest.raises(type(error)):
        write(KINDS[kind][0], tmp_path / "run", failing())
    assert names(tmp_path) == set()


def test_an_empty_stream_is_no_error(kind: str, tmp_path: Path) -> None:
    make, outputs = KINDS[kind]
    write(make, tmp_path, stream(0))
    assert names(tmp_path) == (set() if kind == "video" else outputs)  # a video of nothing is no video


def test_a_stream_of_lost_frames_is_no_error(kind: str, tmp_path: Path) -> None:
    write(KINDS[kind][0], tmp_path, stream(1, lost=0))
    assert "annotated.mp4" not in names(tmp_path)


def test_refuses_what_is_there_already_and_keeps_it(kind: str, tmp_path: Path) -> None:
    make, outputs = KINDS[kind]
    write(make, tmp_path, stream())
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    with pytest.raises(OutputExistsError):
        write(make, tmp_path, stream(0))
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before
    assert names(tmp_path) == outputs


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="needs /proc to see open files")
@pytest.mark.parametrize("fails", [False, True])
def test_closes_what_it_opened(kind: str, tmp_path: Path, fails: bool) -> None:
    def results() -> Iterator[tuple[Frame | LostFrame, FrameResult]]:
        yield from stream()
        if fails:
            raise RuntimeError("boom")

    before = open_files()
    try:
        write(KINDS[kind][0], tmp_path, results())
    except RuntimeError:
        assert fails
    assert not {name for name in open_files() - before if name.startswith(str(tmp_path))}


def test_a_folder_that_cannot_be_made_is_an_output_error(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: Path, *_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(Path, "mkdir", fail)
    with pytest.raises(OutputError, match="Read-only file system; "):
        write(KINDS[kind][0], tmp_path / "run", stream())
    monkeypatch.undo()
    assert names(tmp_path) == set()


def test_the_table_of_sinks_has_them_all(tmp_path: Path) -> None:
    made = {type(make(setup)) for make in SINKS.values() for setup in (SinkSetup(tmp_path), no_clock(tmp_path))}
    assert made == {make for make, _ in KINDS.values()}


def no_clock(folder: Path) -> SinkSetup:
    return SinkSetup(folder, has_clock=False)


class TestWhatIsInside:
    def test_tables_have_a_row_for_every_frame(self, tmp_path: Path) -> None:
        write(CsvSink, tmp_path, stream())
        frames = read_table(tmp_path / "frames.csv")
        assert frames.ints("frame") == [0, 1, 2, 3]
        assert frames.texts("status") == ["ok", "damaged", "damaged", "ok"]

    def test_only_the_chosen_tables(self, tmp_path: Path) -> None:
        with CsvSink(replace(setup_in(tmp_path), tables=("tags.csv",))):
            pass
        assert names(tmp_path) == {"tags.csv"}
        with pytest.raises(UsageError, match=r"unknown table 'x'; known: detections\.csv"):
            CsvSink(replace(setup_in(tmp_path), tables=("x",))).__enter__()

    def test_the_video_has_the_times_of_its_pictures(self, tmp_path: Path) -> None:
        write(VideoSink, tmp_path, stream())
        with av.open(str(tmp_path / "annotated.mp4")) as container:
            frames = list(container.decode(video=0))
        assert [frame.time for frame in frames] == pytest.approx([0.0, 0.08, 0.12])
        assert (frames[0].width, frames[0].height) == SIZE

    def test_a_video_needs_times(self, tmp_path: Path) -> None:
        frame = Frame(3, None, np.zeros((64, 96, 3), np.uint8), file="a.png")
        with pytest.raises(UsageError, match=r"a\.png: frame 3 has no time.*--fps"):
            write(VideoSink, tmp_path, iter([(frame, FrameResult(3, None))]))
        assert names(tmp_path) == set()

    def test_images_keep_their_names_and_sizes(self, tmp_path: Path) -> None:
        sizes = {"b.JPG": (50, 70), "sub/a.png": (64, 96), "c.odd": (5, 7), "": (20, 30)}
        frames = [Frame(i, None, np.full((*s, 3), 90, np.uint8), file=n) for i, (n, s) in enumerate(sizes.items())]
        with ImagesSink(no_clock(tmp_path)) as sink:
            write_all(((frame, FrameResult(frame.index, None)) for frame in frames), [sink])
        expected = dict(zip(["b.JPG", "sub/a.png", "c.odd.png", "000003.png"], sizes.values(), strict=True))
        for name, size in expected.items():
            image = cv2.imread(str(tmp_path / "annotated" / name))
            assert image is not None
            assert image.shape[:2] == size
        assert sink.notes == ["c.odd: annotated as PNG, its own kind cannot be written"]


class TestOpenSinks:
    def test_one_loop_fills_all(self, tmp_path: Path) -> None:
        seen: list[int] = []
        with open_sinks(["csv", "video", "csv"], setup_in(tmp_path)) as sinks:
            written = write_all(stream(), sinks, lambda frame, result: seen.append(frame.index + result.index))
        assert len(sinks) == 2
        assert names(tmp_path) == {*TABLES, "annotated.mp4"}
        assert seen == [0, 2, 4, 6]
        assert (written.frames, written.pictures) == (4, 3)
        assert written.timings["tags"].total_s == 0.75
        assert written.timings["tags"].mean_ms == 250.0
        assert written.timings["write"].frames == 4

    def test_one_that_fails_takes_the_others_back(self, tmp_path: Path) -> None:
        (tmp_path / "annotated.mp4").write_text("old")
        with pytest.raises(OutputExistsError), open_sinks(["csv", "video"], setup_in(tmp_path)):
            pytest.fail("the block must not run")
        assert names(tmp_path) == {"annotated.mp4"}

    def test_unknown_name(self, tmp_path: Path) -> None:
        with (
            pytest.raises(UsageError, match="unknown output 'vidoe'; known: video, csv"),
            open_sinks(["vidoe"], setup_in(tmp_path)),
        ):
            pass
