"""What `inspect` finds out about each kind of input."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from landtool.camera import Camera
from landtool.errors import InputError, UsageError
from landtool.inspect import Facts, Request, inspect
from landtool.inspect.advice import tag_range
from landtool.inspect.clock import Gap, measure_clock
from landtool.inspect.facts import Calibration, CameraFacts, Ego, Mount, Pad, Recording, Settings
from landtool.inspect.text import as_text, as_values
from landtool.inspect.words import clock_lines
from landtool.io.calibration import camera_yaml
from landtool.io.mcap_out import McapImageWriter
from landtool.io.poses import CSV_COLUMNS
from landtool.io.tables import TABLES
from landtool.io.video import VideoSource
from landtool.pad import PadSpec, PadTag, Ring
from landtool.types import Frame
from tests.conftest import HEIGHT, WIDTH, ClipMaker, picture
from tests.shared import shared_data
from tests.unit.io.mcap_logs import (
    NO_INDEX,
    PLAIN,
    START_NS,
    STEP_NS,
    Log,
    even_stamps,
    grey,
    ros_camera_info,
    ros_image,
    write_images,
)

MS = 1_000_000
CAMERA = Camera(WIDTH, HEIGHT, 80.0, 82.0, 47.0, 31.0, "plumb_bob", (0.1, 0.0, 0.0, 0.0, 0.0))


def recording(facts: Facts) -> Recording:
    assert isinstance(facts.facts, Recording)
    return facts.facts


def options(facts: Facts) -> list[str]:
    return [need.option for need in facts.track.needs]


def said(facts: Facts) -> dict[str, str]:
    """The block's lines by label; lines without one joined to the one before."""
    lines: dict[str, str] = {}
    label = ""
    for line in as_text(facts).splitlines()[1:]:
        assert line == line.rstrip()
        new, _, text = line.strip().partition("  ")
        if line[2] == " ":
            lines[label] += "\n" + line.strip()
        else:
            label = new
            lines[label] = f"{lines[label]}\n{text.strip()}" if label in lines else text.strip()
    return lines


# --- clocks --------------------------------------------------------------------------------------------------------


def test_a_clock_that_is_steady() -> None:
    clock = measure_clock([100 * MS * n for n in range(11)], "here")
    assert clock is not None
    assert (clock.times, clock.first_ns, clock.last_ns, clock.span_ns) == (11, 0, 1000 * MS, 1000 * MS)
    assert clock.mean_hz == pytest.approx(10.0)
    assert clock.median_interval_ns == clock.shortest_interval_ns == clock.longest_interval_ns == 100 * MS
    assert (clock.rate_is_variable, clock.gaps, clock.repeated, clock.backward) == (False, (), 0, 0)


@pytest.mark.parametrize("hz", [24, 30, 59.94, 120])
def test_times_rounded_to_a_millisecond_are_steady(hz: float) -> None:
    clock = measure_clock([round(1000 * n / hz) * MS for n in range(300)], "here")
    assert clock is not None
    assert not clock.rate_is_variable
    assert clock.mean_hz == pytest.approx(hz, rel=2e-4)


def test_a_rate_that_changes_is_variable_and_a_lost_frame_is_not() -> None:
    changing = measure_clock([0, *np.cumsum([30 * MS, 40 * MS] * 20).tolist()], "here")
    lost = measure_clock([30 * MS * n for n in range(40) if n != 20], "here")
    assert changing is not None
    assert lost is not None
    assert changing.rate_is_variable
    assert changing.gaps == ()
    assert not lost.rate_is_variable
    assert lost.gaps == (Gap(19, 570 * MS, 60 * MS),)


def test_gaps_are_told_even_when_times_are_rounded() -> None:
    # 1/30 s: one lost frame makes 66666667 ns, less than twice the median of 33333334
    times = [round(n * Fraction(10**9, 30)) for n in range(12) if n not in (4, 8, 9)]
    clock = measure_clock(times, "here")
    assert clock is not None
    assert [gap.after_frame for gap in clock.gaps] == [3, 6]
    assert [gap.length_ns for gap in clock.gaps] == [66_666_667, 100_000_000]


def test_times_that_repeat_and_go_back_are_counted_and_are_no_intervals() -> None:
    clock = measure_clock([0, 10 * MS, 10 * MS, 20 * MS, 15 * MS, 30 * MS], "here")
    assert clock is not None
    assert (clock.repeated, clock.backward) == (1, 1)
    assert clock.shortest_interval_ns == 10 * MS
    assert (clock.first_ns, clock.last_ns) == (0, 30 * MS)


@pytest.mark.parametrize(
    ("times_ms", "order"),
    [
        ((0, 10, 10, 20), "1 time equal to the one before, 0 steps back"),
        ((0, 10, 5, 20, 20, 20), "2 times equal to the one before, 1 step back"),
    ],
)
def test_the_order_of_times_in_words(times_ms: tuple[int, ...], order: str) -> None:
    clock = measure_clock([t * MS for t in times_ms], "file")
    assert clock is not None
    assert dict(clock_lines(clock))["order"] == order


def test_clocks_of_hardly_any_times() -> None:
    assert measure_clock([], "here") is None
    one = measure_clock([7], "here")
    assert one is not None
    assert (one.times, one.mean_hz, one.median_interval_ns, one.rate_is_variable) == (1, None, None, False)
    same = measure_clock([7, 7], "here")
    assert same is not None
    assert (same.mean_hz, same.repeated) == (None, 1)


def test_sorted_times_tell_nothing_of_steps_back() -> None:
    clock = measure_clock([0, 1, 2], "here", in_order=False)
    assert clock is not None
    assert clock.backward is None


# --- video ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("b_frames", [0, 2])
@pytest.mark.parametrize("name", ["clip.mp4", "clip.mkv"])
def test_packets_tell_the_times_that_decoding_gives(make_clip: ClipMaker, name: str, b_frames: int) -> None:
    pts = [512 * n for n in range(20) if n not in (7, 8)]
    path = make_clip(name, pts, b_frames=b_frames)
    quick = recording(inspect(path, Request()))
    slow = recording(inspect(path, Request(scan=True)))
    assert quick.clock is not None
    assert slow.clock is not None
    assert quick.scan is None
    assert replace(slow.clock, source="", backward=None) == replace(quick.clock, source="", backward=None)
    assert (quick.clock.backward, slow.clock.backward) == (None if b_frames else 0, 0)
    assert [(gap.after_frame, round(gap.length_ns / MS)) for gap in quick.clock.gaps] == [(6, 100)]
    with VideoSource(path) as source:
        assert quick.clock.first_ns == next(iter(source)).t_ns


def test_a_video_is_described(make_clip: ClipMaker) -> None:
    path = make_clip("clip.mp4", [512 * n for n in range(12)], gop=5, options={"sc_threshold": "0"})
    facts = inspect(path, Request())
    it = recording(facts)
    assert (facts.kind, facts.format, facts.bytes) == ("video", "QuickTime / MOV", path.stat().st_size)
    assert (facts.damaged, facts.notes) == (False, ())
    assert (it.width_px, it.height_px, it.encoding, it.pixel_format, it.rotation_deg) == (96, 64, "h264", "yuv420p", 0)
    assert (it.frames_declared, it.frames_found, it.key_frames, it.damaged_packets) == (12, 12, 3, 0)
    assert it.duration_ns == 400 * MS
    assert (it.camera, it.ranges, it.log) == (None, (), None)
    text = said(facts)
    assert text["pictures"] == "96 x 64, h264 (High), yuv420p"
    assert text["frames"].startswith("12, 3 key frames (counted;")
    assert text["time"] == "0.367 s from 0.000 s, by packets"
    assert text["rate"] == "30 a second on average, steady, 33.33 ms apart"


def test_a_video_without_calibration_needs_one(make_clip: ClipMaker, tmp_path: Path) -> None:
    path = make_clip("my clip.mp4", [0, 512])
    facts = inspect(path, Request())
    assert facts.track.command == f"landtool track '{path}' --camera CAM.yaml"
    assert "--hfov DEG" in facts.track.needs[0].why
    calibration = tmp_path / "cam.yaml"
    calibration.write_text(camera_yaml(CAMERA))
    ready = inspect(path, Request(camera=calibration))
    assert ready.track.needs == ()
    assert ready.track.command == f"landtool track '{path}' --camera {calibration}"
    guessed = inspect(path, Request(hfov_deg=60.0))
    assert guessed.track.command == f"landtool track '{path}' --hfov 60"
    camera = recording(guessed).camera
    assert camera is not None
    assert camera.hfov_deg == pytest.approx(60.0)
    assert "assumed" in said(guessed)["camera"]


def test_all_that_was_given_is_repeated(make_clip: ClipMaker, tmp_path: Path) -> None:
    path, pad = make_clip("clip.mp4", [0, 512]), tmp_path / "my pad.toml"
    pad.write_text(PadSpec(diameter_m=0.18).to_toml())
    calibration, settings = tmp_path / "cam.yaml", tmp_path / "set.toml"
    calibration.write_text(camera_yaml(CAMERA))
    settings.write_text("[tracker]\nhorizon_s = 1.0\n")
    given = Request(hfov_deg=60.0, size=(96, 64), pad_file=pad)
    assert inspect(path, given).track.command == f"landtool track {path} --hfov 60 --pad '{pad}'"
    assert inspect(pad, given).track.command == f"landtool track RECORDING --pad '{pad}' --hfov 60"
    assert (
        inspect(settings, given).track.command
        == f"landtool track RECORDING --config {settings} --hfov 60 --pad '{pad}'"
    )
    measured = replace(given, hfov_deg=None, camera=calibration)
    assert inspect(path, measured).track.command == f"landtool track {path} --camera {calibration} --pad '{pad}'"
    # the calibration itself stands in for what was given for one
    assert inspect(calibration, given).track.command == f"landtool track RECORDING --camera {calibration} --pad '{pad}'"


def test_what_lies_beside_a_recording_is_proposed(make_clip: ClipMaker, tmp_path: Path) -> None:
    path = make_clip("bend.mp4", [0, 512])
    for ending in ("camera.yaml", "pad.toml", "ego.csv"):
        (path.parent / f"bend.{ending}").touch()
        (path.parent / f"other.{ending}").touch()
    start = path.parent / "bend"
    facts = inspect(path, Request())
    assert facts.track.command == f"landtool track {path} --camera {start}.camera.yaml --pad {start}.pad.toml"
    assert [need.option for need in facts.track.choices] == [f"--ego {start}.ego.csv"]
    given = inspect(path, Request(hfov_deg=60.0, pad_file=tmp_path / "mine.toml"))
    assert given.track.command == f"landtool track {path} --hfov 60 --pad {tmp_path / 'mine.toml'}"


def test_a_calibration_of_another_size_is_said_to_be(make_clip: ClipMaker, tmp_path: Path) -> None:
    path = make_clip("clip.mp4", [0, 512])
    half, square = tmp_path / "half.yaml", tmp_path / "square.yaml"
    half.write_text(camera_yaml(CAMERA.scaled(WIDTH // 2, HEIGHT // 2)))
    square.write_text(camera_yaml(CAMERA.cropped(0, 0, 64, 64)))
    scaled = inspect(path, Request(camera=half))
    assert options(scaled) == ["--scale-intrinsics"]
    assert recording(scaled).camera == CameraFacts.of(CAMERA)
    other = inspect(path, Request(camera=square))
    assert "the calibration is for 64x64, the images are 96x64, a different shape" in other.track.obstacle
    assert recording(other).camera is None
    assert said(other)["to track"].startswith("not possible: the calibration is for 64x64")


def test_a_scan_counts_what_is_damaged(make_clip: ClipMaker) -> None:
    path = make_clip("clip.mkv", [512 * n for n in range(20)], codec="mjpeg")
    data = bytearray(path.read_bytes())
    third = data.index(b"\xff\xda", data.index(b"\xff\xda", data.index(b"\xff\xda") + 1) + 1)
    data[third + 400 : third + 600] = bytes(200)
    path.write_bytes(data)
    facts = inspect(path, Request(scan=True))
    scan = recording(facts).scan
    assert scan is not None
    assert facts.damaged
    assert (scan.decoded, scan.damaged, scan.lost, scan.truncated) == (20, 1, 0, False)
    assert scan.sizes == ((WIDTH, HEIGHT, 20),)
    assert [(fault.frame, fault.lost) for fault in scan.faults] == [(2, False)]
    assert "frame 2 at 0.067 s, damaged: part of its data is zeroed" in said(facts)["scan"]
    assert ", DAMAGED, " in as_text(facts).splitlines()[0]
    quick = inspect(path, Request())
    assert recording(quick).damaged_packets == 1
    assert quick.damaged


def test_a_cut_video_is_damaged_without_a_scan(make_clip: ClipMaker) -> None:
    path = make_clip("clip.mkv", [512 * n for n in range(40)])
    path.write_bytes(path.read_bytes()[:-2000])
    facts = inspect(path, Request())
    assert facts.damaged
    assert "the file ends in the middle of its data" in facts.notes
    assert recording(facts).frames_found < 40


def test_a_scan_is_watched(make_clip: ClipMaker) -> None:
    seen: list[int] = []
    totals: list[int | None] = []

    def watch(frames: Any, total: int | None) -> Any:
        totals.append(total)
        for frame in frames:
            seen.append(frame.index)
            yield frame

    path = make_clip("clip.mp4", [0, 512, 1024])
    inspect(path, Request(watch=watch))
    assert totals == []
    inspect(path, Request(scan=True, watch=watch))
    assert (seen, totals) == ([0, 1, 2], [3])


# --- images --------------------------------------------------------------------------------------------------------


def write_pictures(folder: Path, count: int) -> Path:
    folder.mkdir()
    for number in range(count):
        cv2.imwrite(str(folder / f"{number}.png"), picture(number))
    return folder


def test_a_folder_has_no_clock_until_it_is_given_one(tmp_path: Path) -> None:
    folder = write_pictures(tmp_path / "shots", 3)
    facts = inspect(folder, Request(hfov_deg=50.0))
    assert (facts.kind, facts.format, recording(facts).frames_found) == ("images", "folder of images", 3)
    assert facts.bytes == sum(file.stat().st_size for file in folder.iterdir())
    assert said(facts)["time"] == "none"
    assert facts.track.command == f"landtool track {folder} --hfov 50 --fps F"
    timed = inspect(folder, Request(hfov_deg=50.0, fps=4.0))
    assert timed.track.needs == ()
    assert timed.track.command == f"landtool track {folder} --fps 4 --hfov 50"
    clock = recording(timed).clock
    assert clock is not None
    assert (clock.mean_hz, clock.span_ns, clock.source) == (4.0, 500 * MS, "--fps")


def test_a_single_image_needs_no_clock(tmp_path: Path) -> None:
    folder = write_pictures(tmp_path / "shots", 1)
    facts = inspect(folder / "0.png", Request())
    assert facts.format == "image"
    assert options(facts) == ["--camera CAM.yaml"]


def test_images_of_several_sizes_are_told_by_a_scan(tmp_path: Path) -> None:
    folder = write_pictures(tmp_path / "shots", 3)
    cv2.imwrite(str(folder / "1.png"), picture(1, 64, 96))
    (folder / "2.png").write_bytes(b"nothing")
    facts = inspect(folder, Request(scan=True))
    scan = recording(facts).scan
    assert scan is not None
    assert scan.sizes == ((96, 64, 1), (64, 96, 1))
    assert (scan.decoded, scan.lost, facts.damaged) == (2, 1, True)
    assert "the pictures are not all of one size, a calibration fits only one" in facts.notes
    assert "frame 2 (2.png), lost: is no image that can be read" in said(facts)["scan"]


# --- logs ----------------------------------------------------------------------------------------------------------


def test_a_log_that_is_ready_to_track(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with McapImageWriter(
        path, schema="foxglove", topic="/cam/image", frame_id="cam", camera=CAMERA, encoding="png"
    ) as log:
        for number in range(4):
            log.write(Frame(number, START_NS + number * STEP_NS, picture(number)))
    facts = inspect(path, Request(scan=True))
    it = recording(facts)
    assert facts.track.command == f"landtool track {path}"
    assert (facts.track.needs, facts.damaged) == ((), False)
    assert it.log is not None
    assert it.clock is not None
    assert it.scan is not None
    assert (it.log.indexed, it.log.cut, it.log.topic) == (True, False, "/cam/image")
    assert it.log.library.startswith("landtool/")
    assert [(topic.name, topic.role, topic.messages) for topic in it.log.topics] == [
        ("/cam/calibration", "calibration", 4),
        ("/cam/image", "image", 4),
    ]
    assert it.camera == CameraFacts.of(CAMERA)
    assert (it.clock.source, it.clock.first_ns, it.frames_found, it.scan.decoded) == ("header stamps", START_NS, 4, 4)
    assert said(facts)["time"] == "0.100 s from 2023-11-14 22:13:20.123 UTC, by header stamps"
    assert "range" in said(facts)


def two_topics(path: Path) -> Path:
    with Log(path) as log:
        for number in range(5):
            t_ns = START_NS + number * STEP_NS
            log.ros("/a/image", "sensor_msgs/msg/Image", ros_image(t_ns, grey(number), "mono8"), t_ns)
            if number % 2:
                continue
            log.ros("/b/image", "sensor_msgs/msg/Image", ros_image(t_ns, grey(number), "mono8"), t_ns)
            log.ros("/b/camera_info", "sensor_msgs/msg/CameraInfo", ros_camera_info(t_ns, 64, 48), t_ns)
    return path


def test_two_image_topics_need_a_choice(tmp_path: Path) -> None:
    path = two_topics(tmp_path / "log.mcap")
    facts = inspect(path, Request())
    assert not facts.damaged
    assert options(facts) == ["--topic /a/image", "--camera CAM.yaml"]
    assert facts.track.needs[0].why == "one of 2 image topics, else --topic /b/image"
    assert facts.track.command == f"landtool track {path} --topic /a/image --camera CAM.yaml"
    log = recording(facts).log
    assert log is not None
    rates = {topic.name: topic.clock.mean_hz for topic in log.topics if topic.clock}
    assert rates == {"/a/image": pytest.approx(30.0), "/b/image": pytest.approx(15.0)}
    topics = said(facts)["topics"]
    assert "image, 30 frames/s, no calibration" in topics
    assert "image, 15 frames/s, calibration /b/camera_info" in topics
    chosen = inspect(path, Request(topic="/b/image"))
    assert chosen.track.command == f"landtool track {path} --topic /b/image"
    assert recording(chosen).frames_found == 3
    with pytest.raises(UsageError, match="has no image topic '/c'"):
        inspect(path, Request(topic="/c"))


def test_a_log_without_images_is_no_error(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with Log(path) as log:
        log.raw("/chatter", "std_msgs/msg/String", "cdr", b"\0\1\0\0\0\0\0\0", 5)
    facts = inspect(path, Request())
    assert not facts.damaged
    assert facts.track.command == ""
    assert said(facts)["to track"] == "not possible: there is no image topic; record the camera's"


def test_a_log_tells_of_index_gaps_and_stamps(tmp_path: Path) -> None:
    stamps = even_stamps(8)
    path = write_images(tmp_path / "log.mcap", [*stamps[:3], stamps[3] + STEP_NS, *stamps[5:], stamps[-1]], **NO_INDEX)
    it = recording(inspect(path, Request()))
    assert it.log is not None
    assert it.clock is not None
    assert (it.log.indexed, it.log.cut) == (False, False)
    assert [gap.after_frame for gap in it.clock.gaps] == [2]
    assert it.clock.repeated == 1


def test_stamps_that_are_not_used_are_said_so(tmp_path: Path) -> None:
    path = write_images(tmp_path / "log.mcap", [0] * 4)
    facts = inspect(path, Request())
    clock = recording(facts).clock
    assert clock is not None
    assert clock.source == "times of logging (the stamps are all 0)"
    assert clock.span_ns == 3 * STEP_NS


def test_a_cut_log_is_damaged_and_still_told(tmp_path: Path) -> None:
    path = write_images(tmp_path / "log.mcap", even_stamps(10), chunk_size=4000, **PLAIN)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    facts = inspect(path, Request())
    it = recording(facts)
    assert facts.damaged
    assert it.log is not None
    assert (it.log.indexed, it.log.cut) == (False, True)
    assert 0 < it.frames_found < 10
    assert "without an index, cut" in said(facts)["log"]


def test_a_log_of_pictures_that_cannot_be_read_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with Log(path) as log:
        log.raw("/cam/image", "sensor_msgs/msg/Image", "cdr", b"broken", START_NS)
    facts = inspect(path, Request())
    assert facts.damaged
    assert "not one of the 1 messages of /cam/image gives a picture" in facts.track.obstacle


def test_poses_of_a_log_are_offered(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with McapImageWriter(path, schema="ros2", topic="/cam/image", frame_id="c", camera=CAMERA, encoding="png") as log:
        log.write(Frame(0, START_NS, picture(0)))
        log.write_pose("/odom", START_NS, camera_pose(), frame_id="map")
    assert [need.option for need in inspect(path, Request()).track.choices] == ["--ego /odom"]


def camera_pose() -> Any:
    from landtool.geometry import Pose

    return Pose.identity()


# --- files ---------------------------------------------------------------------------------------------------------

KALIBR = """
cam0:
  camera_model: pinhole
  intrinsics: [400.0, 401.0, 320.0, 240.0]
  distortion_model: radtan
  distortion_coeffs: [0.1, 0.0, 0.0, 0.0]
  resolution: [640, 480]
"""


def test_the_three_formats_of_calibration(tmp_path: Path) -> None:
    path = tmp_path / "a_name_that_tells_nothing"
    path.write_text(camera_yaml(CAMERA))
    ros = inspect(path, Request())
    assert (ros.kind, ros.format, ros.facts) == (
        "calibration",
        "ROS camera_info",
        Calibration((CameraFacts.of(CAMERA),)),
    )
    assert ros.track.command == f"landtool track RECORDING --camera {path}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_FORMAT_YAML)
    for key, value in (("image_width", WIDTH), ("image_height", HEIGHT), ("camera_matrix", CAMERA.matrix)):
        storage.write(key, value)
    storage.write("distortion_coefficients", np.array([CAMERA.distortion]))
    storage.release()
    opencv = inspect(path, Request())
    assert (opencv.format, opencv.facts) == ("OpenCV FileStorage", ros.facts)
    path.write_text(KALIBR)
    kalibr = inspect(path, Request())
    assert kalibr.format == "Kalibr camchain"
    assert "cam0" in said(kalibr)
    path.write_text(KALIBR + KALIBR.replace("cam0", "cam1"))
    two = inspect(path, Request())
    assert two.track.command == f"landtool track RECORDING --camera {path} --camera-name cam0"
    assert isinstance(two.facts, Calibration)
    assert [camera.name for camera in two.facts.cameras] == ["cam0", "cam1"]


def test_json_with_k_and_d_is_a_calibration(tmp_path: Path) -> None:
    path = tmp_path / "cam.json"
    k = [[80.0, 0, 47], [0, 82, 31], [0, 0, 1]]
    path.write_text(json.dumps({"width": 96, "height": 64, "K": k, "D": [0.1, 0, 0, 0, 0]}))
    assert inspect(path, Request()).facts == Calibration((CameraFacts.of(CAMERA),))


def test_a_camera_s_fields_of_view() -> None:
    facts = CameraFacts.of(Camera.from_hfov(640, 480, 90.0))
    assert facts.hfov_deg == pytest.approx(90.0)
    assert facts.vfov_deg == pytest.approx(math.degrees(2 * math.atan(0.75)))


def test_a_pad_with_the_range_of_its_tags(tmp_path: Path) -> None:
    path = tmp_path / "pad.toml"
    pad = PadSpec(name="mine", diameter_m=0.5, letter=None, tags=(PadTag(), PadTag(id=7, size=0.04, x=0.3, yaw_deg=90)))
    path.write_text(pad.to_toml())
    facts = inspect(path, Request())
    it = facts.facts
    assert isinstance(it, Pad)
    assert (facts.kind, it.diameter_mm, it.ring_inner_mm, it.letter_height_mm) == ("pad", 500.0, 420.0, None)
    assert [(tag.tag_id, tag.size_mm, tag.x_mm) for tag in it.tags] == [(5, 80.0, 0.0), (7, 20.0, 150.0)]
    assert (it.ranges, it.whole_from_m) == ((), None)
    assert "tag36h11 id 7: 20 mm, at x 150, y 0 mm, turned 90 degrees" in said(facts)["tags"]
    asked = inspect(path, Request(hfov_deg=60.0, size=(640, 480))).facts
    assert isinstance(asked, Pad)
    assert asked.ranges[0].farthest_m == pytest.approx(4 * asked.ranges[1].farthest_m)
    with pytest.raises(UsageError, match="no range without a picture size; pass --size WxH too"):
        inspect(path, Request(hfov_deg=60.0))


def test_the_range_of_a_tag_is_what_the_camera_sees() -> None:
    camera, pad = Camera(640, 480, 550.0, 560.0, 319.5, 239.5), PadSpec()
    it = tag_range(pad, pad.tags[0], camera)
    # the whole white border is 10 modules, the measured square 8
    near = pad.tag_corners_m(pad.tags[0]) * 10 / 8 + (0, 0, it.nearest_m)
    assert np.ptp(camera.project(near), axis=0).max() == pytest.approx(480)
    far = pad.tag_corners_m(pad.tags[0]) + (0, 0, it.farthest_m)
    assert np.ptp(camera.project(far), axis=0).min() == pytest.approx(13)


def test_a_mount_is_put_in_words(tmp_path: Path) -> None:
    path = tmp_path / "mount.toml"
    half = math.sqrt(0.5)
    path.write_text(
        f"[body_T_camera]\ntranslation_m = [0.1, 0.0, -0.05]\nquaternion_wxyz = [0.0, {half}, {-half}, 0.0]\n"
    )
    facts = inspect(path, Request())
    assert isinstance(facts.facts, Mount)
    assert facts.facts.off_down_deg == pytest.approx(0.0, abs=1e-5)
    assert said(facts)["looks"] == "straight down, along down (-z)"
    assert said(facts)["image top"] == "points along forward (+x)"
    turned = "[body_T_camera]\ntranslation_m = [0, 0, 0]\nquaternion_wxyz = [0.5, -0.5, 0.5, -0.5]\n"
    path.write_text(turned)
    assert said(inspect(path, Request()))["looks"] == "90.0 degrees off straight down, along forward (+x)"


@pytest.mark.parametrize("kind", ["CSV", "TUM"])
def test_the_drone_s_poses(kind: str, tmp_path: Path) -> None:
    rows = [(n * 100 * MS, float(n), 0.0, 5.0, 1.0, 0.0, 0.0, 0.0) for n in range(6) if n != 3]
    if kind == "CSV":
        lines = [",".join(CSV_COLUMNS), *(",".join(map(str, row)) for row in rows)]
    else:
        lines = ["# t x y z q", *(f"{t / 1e9} {x} {y} {z} 0 0 0 1" for t, x, y, z, *_ in rows)]
    path = tmp_path / "poses"
    path.write_text("\n".join(lines))
    facts = inspect(path, Request())
    it = facts.facts
    assert isinstance(it, Ego)
    assert it.clock is not None
    assert (facts.kind, facts.format, it.poses, it.path_m) == ("ego", kind, 5, 5.0)
    assert (it.low_m, it.high_m) == ((0.0, 0.0, 5.0), (5.0, 0.0, 5.0))
    assert [gap.after_frame for gap in it.clock.gaps] == [2]
    assert facts.track.command == f"landtool track RECORDING --ego {path} --camera CAM.yaml"


def test_settings_are_no_pad(tmp_path: Path) -> None:
    path = tmp_path / "track.toml"
    path.write_text('camera = "cam.yaml"\ndiameter_m = 0.5\n[tracker]\nhorizon_s = 1.0\n')
    facts = inspect(path, Request())
    assert facts.facts == Settings({"camera": "cam.yaml", "diameter_m": 0.5, "tracker.horizon_s": 1.0})
    path.write_text('camera = "cam.yaml"\nhorizon_s = 1.0\n')
    with pytest.raises(InputError, match=r"track\.toml: unknown key 'horizon_s'"):
        inspect(path, Request())


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("hello\n", "is text, and none of the files landtool reads; give a video"),
        ("[something]\nelse = 1\n", "is text, and none of the files"),
        (",".join(TABLES["poses.csv"].columns) + "\n", r"is a table landtool wrote \(poses.csv\)"),
        ("frame,t_ns,camera_T_pad_x_m\n0,0,0\n", "is the truth of a recording; give the recording it is about"),
        ("diametre_m = 1.0\n[ring]\nouter = 1.0\n", "unknown key 'diametre_m'; nearest known key is 'diameter_m'"),
        ("diameter_m = \n", "no valid TOML"),
        (camera_yaml(CAMERA).replace("80.0", "0.0"), "focal length 0, 82 is not positive"),
        ("t_ns,x_m,y_m,z_m,qw,qx,qy\n1,2,3,4,5,6,7\n", "needs one column 'qz'"),
        ("1 2 3 4 5 6 7 8\n", "line 1: the quaternion is not of length 1"),
        ("1 0 0 0 0 0 0 1\n2 0 0\n", "line 2: 3 columns where 8 are needed"),
        ("[body_T_camera]\ntranslation_m = [0, 0, 0]\n", "body_T_camera.quaternion_wxyz must be 4 finite numbers"),
        ("", "is empty; record or copy it again"),
        ("\0\1\2binary", "is no video that can be read"),
    ],
)
def test_what_is_refused_says_why(text: str, error: str, tmp_path: Path) -> None:
    path = tmp_path / "input.mp4"
    path.write_text(text)
    with pytest.raises(InputError, match=error) as caught:
        inspect(path, Request())
    assert caught.value.file == str(path)
    assert caught.value.hint or "number" in error or "TOML" in error


def test_requests_that_do_not_fit_are_refused(make_clip: ClipMaker, tmp_path: Path) -> None:
    path = tmp_path / "pad.toml"
    path.write_text(PadSpec().to_toml())
    with pytest.raises(UsageError, match="is no recording; leave out --topic and --fps"):
        inspect(path, Request(fps=5.0))
    with pytest.raises(UsageError, match="leave out --topic"):
        inspect(make_clip("clip.mp4", [0, 512]), Request(topic="/a"))
    playlist = tmp_path / "list.txt"
    playlist.write_text("#EXTM3U\nclip.mp4\n")
    with pytest.raises(UsageError, match="is a playlist"):
        inspect(playlist, Request())
    with pytest.raises(UsageError, match="does not exist"):
        inspect(tmp_path / "none", Request())


def test_inspecting_changes_nothing(make_clip: ClipMaker, tmp_path: Path) -> None:
    path = make_clip("clip.mp4", [0, 512, 1024])
    before = path.read_bytes(), path.stat().st_mtime_ns, sorted(tmp_path.iterdir())
    inspect(path, Request(scan=True))
    assert (path.read_bytes(), path.stat().st_mtime_ns, sorted(tmp_path.iterdir())) == before


def test_values_are_plain_and_finite() -> None:
    assert as_values({"a": (1.0 / 3.0, math.inf, Path("x"), None, True)}) == {
        "a": [0.333333333333, "inf", "x", None, True]
    }


def test_a_pad_without_tags_says_so(tmp_path: Path) -> None:
    path = tmp_path / "pad.toml"
    path.write_text(PadSpec(ring=Ring(), tags=()).to_toml())
    assert said(inspect(path, Request()))["tags"] == "none"


# --- other people's recordings -------------------------------------------------------------------------------------


def test_a_recorded_clip_with_a_lost_frame() -> None:
    facts = inspect(shared_data("tags/wpilib/fieldvideo_long.mp4"), Request())
    clock = recording(facts).clock
    assert clock is not None
    assert (clock.times, [gap.after_frame for gap in clock.gaps]) == (159, [7])


def test_logs_by_other_writers() -> None:
    folder = shared_data("mcap")
    logs = [inspect(path, Request(scan=True)) for path in sorted(folder.glob("*.mcap"))]
    assert {(facts.damaged, facts.track.needs) for facts in logs} == {(False, ())}
    decoded = [scan.decoded for facts in logs if (scan := recording(facts).scan)]
    assert decoded == [90, 10, 24]
    bags = [inspect(path, Request()) for path in sorted((folder / "rosbag2").glob("*.mcap"))]
    assert {facts.track.obstacle for facts in bags} == {"there is no image topic; record the camera's"}


def test_a_turned_recording() -> None:
    it = recording(inspect(shared_data("video/torchcodec/nasa_13013_rotated.mp4"), Request()))
    assert (it.width_px, it.height_px, it.rotation_deg) == (270, 480, 270)
