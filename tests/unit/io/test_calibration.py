"""Every kind of calibration file, good and bad."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.camera import Camera, DistortionModel
from landtool.errors import InputError, OutputExistsError, UsageError
from landtool.io.calibration import camera_yaml, match_camera, read_camera, write_camera
from tests.shared import shared_data

K = (554.25, 551.5, 322.5, 237.0)
FIVE = (-0.28, 0.09, 0.0012, -0.0007, -1e-05)
EIGHT = (5.2, 2.1, 3e-4, -2e-4, 0.11, 5.5, 3.9, 0.5)
FOUR = (0.02, -0.005, 0.001, -0.0002)
PLUMB_BOB = Camera(640, 480, *K, "plumb_bob", FIVE)

ROS = """\
image_width: 640
image_height: 480
camera_name: down
camera_matrix:
  rows: 3
  cols: 3
  data: [554.25, 0, 322.5, 0, 551.5, 237.0, 0, 0, 1]
distortion_model: {model}
distortion_coefficients:
  rows: 1
  cols: {n}
  data: [{d}]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [550, 0, 320, 0, 0, 550, 240, 0, 0, 0, 1, 0]
"""
KALIBR_CAM = """\
{name}:
  T_cam_imu:
  - [1.0, 0.0, 0.0, 0.0]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: []
  camera_model: {kind}
  distortion_coeffs: [{d}]
  distortion_model: {model}
  intrinsics: [554.25, 551.5, 322.5, 237.0]
  resolution: [640, 480]
  rostopic: /{name}/image_raw
  timeshift_cam_imu: 0.001
"""


def ros(model: str = "plumb_bob", d: tuple[float, ...] = FIVE) -> str:
    return ROS.format(model=model, n=len(d), d=", ".join(map(str, d)))


def kalibr(name: str = "cam0", kind: str = "pinhole", model: str = "radtan", d: tuple[float, ...] = FIVE[:4]) -> str:
    return KALIBR_CAM.format(name=name, kind=kind, model=model, d=", ".join(map(str, d)))


@pytest.fixture
def put(tmp_path: Path) -> Callable[[str | bytes], Path]:
    def write(content: str | bytes) -> Path:
        file = tmp_path / "camera.dat"  # the suffix says nothing: the content has to
        file.write_bytes(content.encode() if isinstance(content, str) else content)
        return file

    return write


Put = Callable[[str | bytes], Path]


@pytest.mark.parametrize(
    ("text", "want"),
    [
        (ros(), PLUMB_BOB),
        (ros().replace("distortion_model: plumb_bob\n", ""), PLUMB_BOB),
        ("\ufeff" + ros(), PLUMB_BOB),
        ("%YAML 1.2\n---\n" + ros(), PLUMB_BOB),
        (ros(d=FIVE[:4]), Camera(640, 480, *K, "plumb_bob", (*FIVE[:4], 0.0))),
        (ros(d=()), Camera(640, 480, *K)),
        (ros("''", ()), Camera(640, 480, *K)),
        (ros("rational_polynomial", EIGHT), Camera(640, 480, *K, "rational_polynomial", EIGHT)),
        (ros("''", EIGHT), Camera(640, 480, *K, "rational_polynomial", EIGHT)),
        (ros("equidistant", FOUR), Camera(640, 480, *K, "equidistant", FOUR)),
        (ros("kannala_brandt", FOUR), Camera(640, 480, *K, "equidistant", FOUR)),
        (kalibr(), Camera(640, 480, *K, "plumb_bob", (*FIVE[:4], 0.0))),
        (kalibr(model="equidistant", d=FOUR), Camera(640, 480, *K, "equidistant", FOUR)),
        (kalibr(model="none", d=()), Camera(640, 480, *K)),
    ],
)
def test_ros_and_kalibr_files(text: str, want: Camera, put: Put) -> None:
    assert read_camera(put(text)) == want


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
@pytest.mark.parametrize("names", [("camera_matrix", "distortion_coefficients"), ("cameraMatrix", "dist_coeffs")])
@pytest.mark.parametrize("size", ["image_width", "imageSize"])
@pytest.mark.parametrize("d", [FIVE, EIGHT])
def test_opencv_files_in_every_syntax(
    suffix: str, names: tuple[str, str], size: str, d: tuple[float, ...], tmp_path: Path, put: Put
) -> None:
    made = tmp_path / f"made.{suffix}"
    storage = cv2.FileStorage(str(made), cv2.FILE_STORAGE_WRITE)
    if size == "imageSize":
        storage.startWriteStruct("imageSize", cv2.FileNode_SEQ)
        storage.write("", 640)
        storage.write("", 480)
        storage.endWriteStruct()
    else:
        storage.write("image_width", 640)
        storage.write("image_height", 480)
    storage.write(names[0], np.array([[K[0], 0.0, K[2]], [0.0, K[1], K[3]], [0.0, 0.0, 1.0]]))
    storage.write(names[1], np.array([d]))
    storage.release()
    model: DistortionModel = "plumb_bob" if d == FIVE else "rational_polynomial"
    assert read_camera(put(made.read_bytes())) == Camera(640, 480, *K, model, d)


OPENCV_4 = """\
%YAML:1.0
---
calibration_time: "Thu 01 Jan 2026 00:00:00"
image_width: 640
image_height: 480
flags: 0
fisheye_model: {fisheye}
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.5425e+02, 0., 322.5, 0., 551.5, 237., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: {n}
   cols: 1
   dt: d
   data: [ {d} ]
avg_reprojection_error: 2.0e-01
"""


@pytest.mark.parametrize(("fisheye", "d", "model"), [(0, FIVE, "plumb_bob"), (1, FOUR, "equidistant")])
def test_what_opencv_4_s_calibration_program_writes(fisheye: int, d: tuple[float, ...], model: str, put: Put) -> None:
    text = OPENCV_4.format(fisheye=fisheye, n=len(d), d=", ".join(map(str, d)))
    camera = read_camera(put(text))
    assert (camera.model, camera.distortion) == (model, d)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == K


def test_plain_json_with_nested_lists(put: Put) -> None:
    matrix = [[K[0], 0, K[2]], [0, K[1], K[3]], [0, 0, 1]]
    text = json.dumps({"width": 640, "height": 480, "K": matrix, "D": FIVE, "rms_px": 0.3})
    assert read_camera(put(text)) == PLUMB_BOB


def test_json_as_opencv_4_writes_it(put: Put) -> None:
    matrix = "[ 5., 0., 3., 0., 6., 4., 0., 0., 1. ]"
    text = f'{{"image_width": 640, "image_height": 480, "K": {matrix}, "D": [ 0., 0., 0., 0. ]}}'
    assert read_camera(put(text)) == Camera(640, 480, 5.0, 6.0, 3.0, 4.0)


def test_real_calibrations_are_read() -> None:
    camera = read_camera(shared_data("tags/wpilib/camera_fieldvideo.json"))
    assert (camera.width, camera.height, camera.model) == (1920, 1080, "plumb_bob")
    assert read_camera(shared_data("tags/swatbotics/camera.json")).fx == 765.0


def test_a_camera_of_a_chain_is_chosen_by_name(put: Put) -> None:
    chain = put(kalibr("cam0") + kalibr("cam1", model="equidistant", d=FOUR))
    assert read_camera(chain, "cam0").model == "plumb_bob"
    assert read_camera(chain, "cam1").model == "equidistant"
    with pytest.raises(UsageError, match="cam0, cam1"):
        read_camera(chain)
    with pytest.raises(UsageError, match="it holds cam0, cam1"):
        read_camera(chain, "cam2")


def test_a_name_for_a_file_of_one_camera_is_refused(put: Put) -> None:
    with pytest.raises(UsageError, match="leave the camera's name out"):
        read_camera(put(ros()), "cam0")


FX = "554.25, 0, 322.5"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b" \n", "is empty"),
        (b"\x00\x00\x00\x18ftypisom", "binary"),
        (b"\xff\xd8\xff\xe0", "binary"),
        (b"a: 1\n" * 300_000, "large"),
        ("just a text", "holds no calibration"),
        ("- 1\n- 2", "holds no calibration"),
        ("a: [1, 2", "is no valid YAML"),
        ("a: b: c", "line 1"),
        ("when: 2020-13-45", "is no valid YAML"),
        ("[" * 3000, "is no valid YAML"),
        ("a: &a [*a]\nb: 1", "holds no camera matrix"),
        ("<html><body>404</body></html>", ""),
        ("%YAML:1.0\n---\ncamera_matrix: [", "is no valid YAML"),
        ("%YAML:1.0\n---\nother: 1\n", "holds no camera matrix"),
        ("!!python/object/apply:os.system ['true']", "is no valid YAML"),
        ("diameter_m: 1.0", "holds no camera matrix"),
        ("K: &a [*a]\nwidth: 1\nheight: 1\nD: []", "no number"),
        (ros().replace("image_width: 640\n", ""), "holds no image size"),
        (ros().replace("image_width: 640", "image_width: 0"), "not positive"),
        (ros().replace("image_width: 640", "image_width: 640.5"), "not whole"),
        (ros().replace("image_width: 640", "image_width: wide"), "no number"),
        (ros().replace("image_width: 640", "image_width: .nan"), "not whole"),
        (ros().replace(FX, "0, 0, 0"), "not positive"),
        (ros().replace(FX, "-5, 0, 320"), "not positive"),
        (ros().replace(FX, ".nan, 0, 320"), "not a finite"),
        (ros().replace(FX, "nan, 0, 320"), "not a finite"),
        (ros().replace(FX, ".inf, 0, 320"), "not a finite"),
        (ros().replace(FX, "554, 3, 320"), "skew"),
        (ros().replace(FX, "554, 0"), "8 values where 9"),
        (ros().replace(FX, "554, 0, true"), "no number"),
        (ros().replace(FX, "554, 0, wide"), "no number"),
        (ros().replace("0, 0, 1]\ndistortion_model", "0, 0, 2]\ndistortion_model"), "not of the form"),
        (ros().replace("distortion_coefficients", "coefficients"), "holds no distortion coefficients"),
        (ros(d=(0.1, 0.2)), "needs 5 distortion coefficients, got 2"),
        (ros(d=EIGHT), "needs 5 distortion coefficients, got 8"),
        (ros("rational_polynomial", FIVE), "needs 8"),
        (ros("equidistant", ()), "needs 4"),
        (ros("fov", (0.9,)), "unknown distortion model 'fov'"),
        (ros("[a]", FIVE), "unknown distortion model"),
        (ros("rational_polynomial", (*EIGHT, 0.1, 0.0, 0.0, 0.0)), "12 distortion coefficients"),
        (ros("rational_polynomial", (*EIGHT, *(0.0,) * 6)), "keep the first 8"),
        (ros(d=(float("nan"), 0, 0, 0, 0)), "not a finite"),
        (kalibr(kind="omni"), "camera model 'omni'"),
        (kalibr(model="fov", d=(0.9,)), "unknown distortion model 'fov'"),
        (kalibr().replace("554.25, 551.5,", "554.25,"), "3 values where 4"),
        (kalibr().replace("  resolution: [640, 480]\n", ""), "holds no image size"),
    ],
)
def test_what_cannot_be_used_is_said_in_one_line(content: str | bytes, said: str, put: Put) -> None:
    file = put(content)
    with pytest.raises(InputError) as caught:
        read_camera(file)
    assert said in str(caught.value)
    assert str(caught.value).startswith(f"{file}: ")
    assert "\n" not in str(caught.value)


def test_a_path_that_is_no_file_is_a_wrong_request(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.yaml"):
        with pytest.raises(UsageError) as caught:
            read_camera(path)
        assert str(path) in str(caught.value)


def test_bad_files_leave_nothing_on_the_terminal(put: Put, capfd: pytest.CaptureFixture[str]) -> None:
    for text in ("%YAML:1.0\n---\na: [", "<opencv_storage><a>"):
        with pytest.raises(InputError):
            read_camera(put(text))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "camera",
    [
        PLUMB_BOB,
        Camera(1920, 1080, 1 / 3e-3, 1e3 / 7, 1e-7, 1e22, "rational_polynomial", EIGHT),
        Camera(640, 480, *K, "equidistant", FOUR),
        Camera.from_hfov(641, 479, 63.7),
    ],
)
def test_what_is_written_comes_back_equal(camera: Camera, tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    write_camera(camera, file)
    assert read_camera(file) == camera
    assert list(tmp_path.iterdir()) == [file]
    with pytest.raises(OutputExistsError):
        write_camera(camera, file)
    write_camera(PLUMB_BOB, file, overwrite=True)
    assert read_camera(file) == PLUMB_BOB


def test_written_file_has_ros_s_keys() -> None:
    text = camera_yaml(PLUMB_BOB, "down")
    for key in ("image_width: 640", "camera_name: down", "distortion_model: plumb_bob", "rows: 3", "cols: 4"):
        assert key in text
    assert "data: [554.25, 0.0, 322.5, 0.0, 551.5, 237.0, 0.0, 0.0, 1.0]" in text


def test_match_keeps_a_camera_of_the_right_size() -> None:
    assert match_camera(PLUMB_BOB, 640, 480, scale=False) is PLUMB_BOB
    assert match_camera(PLUMB_BOB, 640, 480, scale=True) is PLUMB_BOB


def test_match_scales_only_when_asked_and_of_the_same_shape() -> None:
    assert match_camera(PLUMB_BOB, 1280, 960, scale=True) == PLUMB_BOB.scaled(1280, 960)
    assert match_camera(PLUMB_BOB, 640, 483, scale=True) == PLUMB_BOB.scaled(640, 483)  # within 1 %
    with pytest.raises(InputError, match=r"640x480.*1280x960.*--scale-intrinsics"):
        match_camera(PLUMB_BOB, 1280, 960, scale=False)
    for scale in (False, True):
        with pytest.raises(InputError, match=r"640x480.*1280x720.*different shape"):
            match_camera(PLUMB_BOB, 1280, 720, scale=scale)
