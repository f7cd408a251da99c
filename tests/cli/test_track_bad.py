"""`landtool track` on requests and recordings that are not good: one line, the right code, nothing left behind."""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import pytest

from landtool.camera import Camera
from landtool.io.calibration import camera_yaml
from tests.cli.conftest import Track
from tests.cli.landing import CAMERA, Landing, cut, snapshot
from tests.unit.io.mcap_logs import START_NS, Log, even_stamps, grey, namespace, ros_image, write_images

Make = Callable[[Landing, Path], object]
CAM = "--camera camera.yaml"


def file(name: str, content: str | bytes) -> Make:
    """Return what writes a file."""
    data = content.encode() if isinstance(content, str) else content
    return lambda _, here: (here / name).write_bytes(data)


def camera(old: str, new: str, base: Camera = CAMERA) -> Make:
    """Return what writes bad.yaml: a camera with a part of its text changed."""
    assert old in camera_yaml(base)
    return file("bad.yaml", camera_yaml(base).replace(old, new, 1))


def no_frames(landing: Landing, here: Path) -> None:
    data = landing.remuxed(here / "none.mkv").read_bytes()
    (here / "none.mkv").write_bytes(data[: data.find(b"\x1f\x43\xb6\x75")])  # up to the first cluster


def unknown_compression(landing: Landing, here: Path) -> None:
    data = landing.log(here / "log.mcap").read_bytes()
    (here / "log.mcap").write_bytes(data.replace(struct.pack("<I", 4) + b"zstd", struct.pack("<I", 4) + b"brot"))


def no_image_topic(_: Landing, here: Path) -> None:
    with Log(here / "log.mcap") as log:
        log.ros("/chatter", "std_msgs/msg/String", namespace(data="hello"), START_NS)


def two_image_topics(_: Landing, here: Path) -> None:
    with Log(here / "log.mcap") as log:
        for topic in ("/left/image", "/right/image"):
            log.ros(topic, "sensor_msgs/msg/Image", ros_image(START_NS, grey(3), "mono8"), START_NS)


def taken(_: Landing, here: Path) -> None:
    (here / "out/clip").mkdir(parents=True)
    (here / "out/clip/notes.txt").write_text("mine")


def camera_in_the_output(_: Landing, here: Path) -> None:
    (here / "out/clip").mkdir(parents=True)
    (here / "out/clip/run.json").write_text("{}")
    (here / "camera.yaml").rename(here / "out/clip/camera.yaml")


def folder_of_a_log(_: Landing, here: Path) -> None:
    (here / "bag").mkdir()
    write_images(here / "bag/a.mcap", even_stamps(2))


def nothing(*_: object) -> None:
    pass


EMPTY_VIDEO = file("empty.mp4", b"")
# what there is, what is typed after `landtool track`, the exit code, and the line
BAD: dict[str, tuple[Make, str, int, str]] = {
    "empty file": (EMPTY_VIDEO, f"empty.mp4 {CAM}", 1, "empty.mp4: is empty; "),
    "text": (file("t.mp4", "hello\n" * 99), f"t.mp4 {CAM}", 1, "t.mp4: is no video that can be read ("),
    "no moov": (
        lambda _, here: cut(here / "clip.mp4", 0.9),
        f"clip.mp4 {CAM}",
        1,
        "clip.mp4: has no index (moov box), its recording was never finished; repair it",
    ),
    "zeros": (file("z.mp4", bytes(9999)), f"z.mp4 {CAM}", 1, "z.mp4: begins with nothing but zero bytes; "),
    "zero frames": (no_frames, f"none.mkv {CAM}", 1, "none.mkv: holds no picture, it ends after its header; "),
    "ROS 1 bag": (
        file("a.bag", b"#ROSBAG V2.0\n" + bytes(99)),
        f"a.bag {CAM}",
        1,
        "a.bag: is a ROS 1 bag, not an MCAP",
    ),
    "too small": (
        lambda _, here: cv2.imwrite(str(here / "a.png"), grey(1, 2, 2)),
        "a.png --hfov 60",
        1,
        "a.png: its pictures of 2x2 pixels are too small to show a tag; ",
    ),
    "log cut in its head": (
        lambda landing, here: cut(landing.log(here / "log.mcap"), 0.0005),
        "log.mcap",
        1,
        "log.mcap: is cut before its first topic; ",
    ),
    "log of unknown compression": (unknown_compression, "log.mcap", 1, "log.mcap: a chunk's compression 'brot' is"),
    "no image topic": (no_image_topic, "log.mcap", 1, "log.mcap: holds no image topic; it holds /chatter (std_msgs/"),
    "two image topics": (two_image_topics, f"log.mcap {CAM}", 2, "log.mcap: holds 2 image topics: /left/image (sensor"),
    "another topic": (
        lambda _, here: write_images(here / "log.mcap", even_stamps(2)),
        f"log.mcap {CAM} --topic /camera/image",
        2,
        "log.mcap: has no image topic '/camera/image'; it has /camera/image_raw",
    ),
    "log without a camera": (
        lambda landing, here: landing.log(here / "log.mcap", camera=None),
        "log.mcap",
        2,
        "log.mcap: no camera calibration; pass --camera FILE, or --hfov DEG",
    ),
    "no camera": (nothing, "clip.mp4", 2, "clip.mp4: no camera calibration; pass --camera FILE, or --hfov DEG"),
    "fx = 0": (
        camera("data: [300.0", "data: [0.0"),
        "clip.mp4 --camera bad.yaml",
        1,
        "bad.yaml: focal length 0, 300 is",
    ),
    "fx NaN": (
        camera("data: [300.0", "data: [.nan"),
        "clip.mp4 --camera bad.yaml",
        1,
        "bad.yaml: a camera parameter is",
    ),
    "fx huge": (
        camera("[300.0", "[1.0e+300"),
        "clip.mp4 --camera bad.yaml",
        1,
        "bad.yaml: a focal length of 1e+300, 300",
    ),
    "folded lens": (
        camera("data: [0.0, 0.0, 0.0, 0.0, 0.0]", "data: [-9.0, 0.0, 0.0, 0.0, 0.0]"),
        "clip.mp4 --camera bad.yaml",
        1,
        "bad.yaml: its distortion folds images of 320x240 onto themselves; ",
    ),
    "camera of another size": (
        file("bad.yaml", camera_yaml(CAMERA.scaled(640, 480))),
        "clip.mp4 --camera bad.yaml",
        1,
        "bad.yaml: the calibration is for 640x480, the images are 320x240; pass --scale-intrinsics if",
    ),
    "camera of another shape": (
        file("bad.yaml", camera_yaml(CAMERA.scaled(640, 360))),
        "clip.mp4 --camera bad.yaml --scale-intrinsics",
        1,
        "bad.yaml: the calibration is for 640x360, the images are 320x240, a different shape; ",
    ),
    "video as camera": (nothing, "clip.mp4 --camera clip.mp4", 1, "clip.mp4: is no calibration but a large or binary"),
    "camera before recording": (
        EMPTY_VIDEO,
        "none.mp4 --camera empty.mp4",
        1,
        "empty.mp4: is empty; give a ROS camera",
    ),
    "no such camera": (
        nothing,
        "clip.mp4 --camera camra.yaml",
        2,
        "camra.yaml: does not exist; did you mean camera.yaml?",
    ),
    "name without a camera": (nothing, "clip.mp4 --hfov 60 --camera-name cam0", 2, "a camera's name, but no file"),
    "pad with an unknown key": (
        file("pad.toml", "diamter_m = 1.0\n"),
        f"clip.mp4 {CAM} --pad pad.toml",
        1,
        "pad.toml: unknown key 'diamter_m'; nearest known key is 'diameter_m'",
    ),
    "pad of a kilometre": (
        file("pad.toml", "diameter_m = 1e3\n"),
        f"clip.mp4 {CAM} --pad pad.toml",
        1,
        "pad.toml: diam",
    ),
    "settings with an unknown key": (
        file("run.toml", "[tracker]\nhorizon = 1\n"),
        f"clip.mp4 {CAM} --config run.toml",
        1,
        "run.toml: unknown key 'tracker.horizon'; nearest known key is 'tracker.horizon_s'",
    ),
    "settings out of bounds": (
        file("run.toml", "diameter_m = 0\n"),
        f"clip.mp4 {CAM} --config run.toml",
        2,
        "run.toml: diam",
    ),
    "unknown output": (nothing, f"clip.mp4 {CAM} --save vidoe", 2, "unknown output 'vidoe'; known: video, csv"),
    "family not read": (nothing, f"clip.mp4 {CAM} --family tag25h9", 2, "--family is read only with --tags all; "),
    "no own poses": (nothing, f"clip.mp4 {CAM} --ego clop.csv", 2, "clop.csv: does not exist; check the names in ."),
    "output exists": (taken, f"clip.mp4 {CAM}", 2, "out/clip: exists already; choose another -o or pass --overwrite"),
    "output not ours": (taken, f"clip.mp4 {CAM} --overwrite", 2, "out/clip: holds files landtool did not write; "),
    "output is the input": (
        lambda landing, here: landing.images(here / "out"),
        f"out {CAM} -o . --overwrite",
        2,
        "out: is the input itself, which is never changed; choose another -o",
    ),
    "output holds the camera": (
        camera_in_the_output,
        "clip.mp4 --camera out/clip/camera.yaml --overwrite",
        2,
        "out/clip: holds the input out/clip/camera.yaml; choose another -o",
    ),
    "output is a file": (
        file("a.txt", "mine"),
        f"clip.mp4 {CAM} -o a.txt",
        2,
        "a.txt: is no folder; choose another -o",
    ),
    "output under a file": (
        file("a.txt", ""),
        f"clip.mp4 {CAM} -o a.txt/b",
        1,
        "a.txt/b/clip: cannot be written: Not a",
    ),
    "same stem": (
        lambda landing, here: landing.log(here / "clip.mcap"),
        f"clip.mp4 clip.mcap {CAM}",
        2,
        "clip.mcap: would write to the same folder as clip.mp4; run them apart",
    ),
    "wrong path": (nothing, f"clap.mp4 {CAM}", 2, "clap.mp4: does not exist; did you mean clip.mp4?"),
    "no folder": (
        nothing,
        f"nowhere/clip.mp4 {CAM}",
        2,
        "nowhere/clip.mp4: does not exist; there is no folder nowhere",
    ),
    "link to nothing": (lambda _, here: (here / "a").symlink_to("b"), f"a {CAM}", 2, "a: is a link to nothing; "),
    "link to itself": (
        lambda _, here: (here / "a").symlink_to("a"),
        f"a {CAM}",
        2,
        "a: cannot be opened (Too many lev",
    ),
    "empty folder": (lambda _, here: (here / "shots").mkdir(), f"shots {CAM}", 1, "shots: is an empty folder; "),
    "folder without images": (
        folder_of_a_log,
        f"bag {CAM}",
        1,
        "bag: holds no images; give the recording in it: bag/a.mcap",
    ),
    "URL": (nothing, f"https://example.org/clip.mp4 {CAM}", 2, "https://example.org/clip.mp4: is no local file; "),
    "stream": (nothing, f"rtsp://10.0.0.1/live {CAM}", 2, "rtsp://10.0.0.1/live: is no local file; "),
    "/dev/null": (nothing, f"/dev/null {CAM}", 2, "/dev/null: is no plain file or folder; "),
    "pipe": (lambda _, here: os.mkfifo(here / "pipe"), f"pipe {CAM}", 2, "pipe: is no plain file or folder; "),
    "pipe as camera": (lambda _, here: os.mkfifo(here / "pipe"), "clip.mp4 --camera pipe", 2, "pipe: is no plain file"),
    "playlist": (file("a.m3u8", "#EXTM3U\nclip.mp4\n"), f"a.m3u8 {CAM}", 2, "a.m3u8: is a playlist, not a recording; "),
    "--fps on a video": (nothing, f"clip.mp4 {CAM} --fps 30", 2, "clip.mp4: has its own clock; leave out --fps"),
    "--topic on a video": (
        nothing,
        f"clip.mp4 {CAM} --topic /image",
        2,
        "clip.mp4: has no topics, only an MCAP log has; ",
    ),
    "both cameras": (nothing, f"clip.mp4 {CAM} --hfov 60", 2, "--camera and --hfov exclude each other; "),
    "no such option": (nothing, "clip.mp4 --camra camera.yaml", 2, "no such option '--camra'; did you mean --camera"),
}
if sys.platform == "linux":  # where any bytes are a name
    BAD["name that is no text"] = (nothing, f"cl\udcff.mp4 {CAM}", 2, "cl")


@pytest.mark.parametrize(("make", "typed", "code", "line"), BAD.values(), ids=list(BAD))
def test_one_line_and_nothing_left(
    make: Make, typed: str, code: int, line: str, track: Track, landing: Landing, here: Path
) -> None:
    make(landing, here)
    before = snapshot(here)
    args = typed.split() + ([] if "-o" in typed.split() else ["-o", "out"])
    told = track(*args)
    assert told.lines == [told.err.strip()]
    assert told.err.startswith(f"landtool: error: {line}")
    assert told.err.partition("; ")[2].strip(), "it must say what to do"
    assert told.code == code
    assert told.out == ""
    assert snapshot(here) == before
