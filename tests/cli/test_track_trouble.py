"""`landtool track` on recordings that lost something, on disks that take no more, and told to stop."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import pytest

from landtool.io.source import open_source
from landtool.io.tables import TableWriter, read_table
from tests.cli.conftest import Track
from tests.cli.landing import TIMES_NS, Landing, cut, snapshot, zeroed

COUNT = len(TIMES_NS)
CAM = ("--camera", "camera.yaml")
FRONT = {"movflags": "faststart"}


def broken_images(landing: Landing, here: Path) -> Path:
    folder = landing.images(here / "rec")
    cut(folder / "img1.png", 0.3)
    return folder


def images_of_three_sizes(landing: Landing, here: Path) -> Path:
    folder = landing.images(here / "rec")
    cv2.imwrite(str(folder / "img2.png"), cv2.resize(landing.pictures[2], (640, 480)))
    cv2.imwrite(str(folder / "img3.png"), landing.pictures[3][:2, :2])  # so small that the AprilTag library crashes
    return folder


# how the recording is made, the least number of pictures it still gives, and what is said of it
LOSSES: dict[str, tuple[Callable[[Landing, Path], Path], int, str]] = {
    "cut video": (
        lambda landing, here: cut(landing.remuxed(here / "rec.mp4", FRONT), 0.7),
        5,
        "frames before the end of its index",
    ),
    "cut mkv": (
        lambda landing, here: cut(landing.remuxed(here / "rec.mkv"), 0.7),
        5,
        "the file ends in the middle of its data",
    ),
    "a tenth zeroed": (
        lambda landing, here: zeroed(landing.remuxed(here / "rec.mp4", FRONT), 0.5),
        7,
        f", of {COUNT} frames",
    ),
    "cut log": (lambda landing, here: cut(landing.log(here / "rec.mcap"), 0.7), 5, "the log is cut at byte"),
    "log, a tenth zeroed": (
        lambda landing, here: zeroed(landing.log(here / "rec.mcap"), 0.5),
        5,
        "a chunk cannot be decompressed",
    ),
    "broken image": (broken_images, 3, "damaged 0, lost 1, of 4 frames"),
    "images of three sizes": (
        images_of_three_sizes,
        4,
        "pictures not of the camera's 320x240, no pose is measured in them: 2",
    ),
}


@pytest.mark.parametrize(("make", "least", "said"), LOSSES.values(), ids=list(LOSSES))
def test_what_is_left_is_tracked_and_the_loss_is_told(
    make: Callable[[Landing, Path], Path], least: int, said: str, track: Track, landing: Landing, here: Path
) -> None:
    path = make(landing, here)
    before = snapshot(here)
    told = track(path.name, *CAM, "-o", "out")
    assert told.code == 3
    assert all(line.startswith(f"landtool: warning: {path.name}: ") for line in told.lines)
    assert said in told.err
    assert told.out.startswith(f"{path.name}: out/rec\n")
    folder = here / "out/rec"
    record: dict[str, Any] = json.loads((folder / "run.json").read_text())
    assert record["exit_code"] == 3
    counts = record["counts"]
    assert counts["written"] == counts["decoded"] >= least
    statuses = read_table(folder / "frames.csv").texts("status")
    assert len(statuses) == counts["decoded"] + counts["lost"]
    assert statuses.count("damaged") == counts["damaged"] + counts["lost"]
    assert least - 2 <= len(read_table(folder / "poses.csv")) < (4 if path.is_dir() else COUNT)
    annotated = folder / ("annotated" if path.is_dir() else "annotated.mp4")
    assert len(list(open_source(annotated))) == counts["written"]
    assert snapshot(here, without=["out"]) == before


# --- outputs that cannot be written ----------------------------------------------------------------------------------


@pytest.fixture
def disk(here: Path) -> Iterator[Callable[[str], Path]]:
    """Return a function that mounts a disk with the given options; the test is skipped where that is not allowed."""
    place = here / "disk"
    place.mkdir()

    def mount(options: str) -> Path:
        if sys.platform != "linux" or not shutil.which("mount"):
            pytest.skip("needs Linux's mount")
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place)], capture_output=True)
        if done.returncode:
            pytest.skip(f"may not mount a disk: {done.stderr.decode().strip()}")
        return place

    yield mount
    if place.is_mount():
        subprocess.run(["umount", str(place)], check=True)


@pytest.mark.parametrize(
    ("options", "save"),
    [("nr_inodes=1", "csv,video"), ("size=12k", "csv"), ("size=16k", "video"), ("size=40k", "csv,video")],
)
def test_a_full_disk(options: str, save: str, track: Track, here: Path, disk: Callable[[str], Path]) -> None:
    """It is full at once, after some tables, in the middle of the video, or at its end."""
    place = disk(options)
    before = snapshot(here)
    told = track("clip.mp4", *CAM, "-o", "disk/out", "--save", save)
    assert told.lines == [told.err.strip()]
    assert told.err.startswith("landtool: error: disk/out/clip")
    assert ".landtool-" not in told.err
    assert "No space left on device" in told.err
    assert "; free some space" in told.err
    assert (told.code, told.out) == (1, "")
    assert list(place.iterdir()) == []
    assert snapshot(here) == before


def test_a_disk_that_is_only_read(track: Track, here: Path, disk: Callable[[str], Path]) -> None:
    disk("ro")
    before = snapshot(here)
    told = track("clip.mp4", *CAM, "-o", "disk/out")
    assert told.code == 1
    assert told.lines == [
        "landtool: error: disk/out/clip: cannot be written: Read-only file system; "
        "choose another -o on a writable file system"
    ]
    assert snapshot(here) == before


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EDQUOT])
def test_a_write_that_fails(number: int, track: Track, here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same where no disk can be mounted."""
    write = TableWriter.write

    def failing(self: TableWriter, result: Any) -> None:
        if result.index == 5:
            raise OSError(number, os.strerror(number))
        write(self, result)

    monkeypatch.setattr(TableWriter, "write", failing)
    before = snapshot(here)
    told = track("clip.mp4", *CAM, "-o", "out")
    assert told.code == 1
    # all outputs are open until the end, so any of them may be the one that is named
    assert re.match(rf"landtool: error: out/clip/[\w.]+: cannot be written: {os.strerror(number)}; ", told.err)
    assert told.err.count("\n") == 1
    assert [thread.name for thread in threading.enumerate() if "prefetch" in thread.name] == []
    assert snapshot(here) == before


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="permissions do not bind root")
def test_a_folder_without_permission(track: Track, here: Path) -> None:
    (here / "locked").mkdir(mode=0o555)
    told = track("clip.mp4", *CAM, "-o", "locked")
    assert told.code == 1
    assert told.err.startswith("landtool: error: locked/clip: cannot be written: Permission denied; change the folder")


def test_an_old_output_stays_when_the_new_one_fails(track: Track, here: Path) -> None:
    assert track("clip.mp4", *CAM, "-o", "out").code == 0
    before = snapshot(here / "out")
    cut(here / "clip.mp4", 0.9)
    assert track("clip.mp4", *CAM, "-o", "out", "--overwrite").code == 1
    assert snapshot(here / "out") == before


# --- told to stop ----------------------------------------------------------------------------------------------------


@pytest.mark.skipif(os.name != "posix", reason="POSIX signals")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_in_the_middle(number: signal.Signals, code: int, landing: Landing, here: Path) -> None:
    landing.video(here / "long.mp4", times=60)
    before = snapshot(here)
    start = [sys.executable, "-c", "from landtool_cli.main import main; main()", "track", "clip.mp4", "long.mp4"]
    with subprocess.Popen([*start, *CAM, "-o", "out"], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        while not list((here / "out").glob(".landtool-*/.landtool-*.mp4")) or not (here / "out/clip").exists():
            assert process.poll() is None, "it ended before it was told to"
            time.sleep(0.01)
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    assert process.returncode == code
    assert err.startswith(b"landtool: error: ")
    assert err.count(b"\n") == 1
    assert [path.name for path in (here / "out").iterdir()] == ["clip"]  # finished before, so it stays
    assert out.startswith(b"clip.mp4: out/clip\n")
    assert b"long.mp4" not in out
    assert snapshot(here, without=["out"]) == before
