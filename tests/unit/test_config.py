from __future__ import annotations

from pathlib import Path

import pytest

from landtool.config import DetectConfig, TrackConfig, configured, read_config
from landtool.errors import InputError, UsageError


def test_values_go_where_they_belong() -> None:
    config = configured(TrackConfig(), {"fps": 10, "save": "csv", "tags": {"tone": "2.2"}, "tracker": {"horizon_s": 1}})
    assert (config.fps, config.save, config.tags.tone, config.tracker.horizon_s) == (10.0, ("csv",), "2.2", 1.0)


def test_later_values_win() -> None:
    config = configured(configured(TrackConfig(), {"topic": "/a", "fps": 5.0}), {"topic": "/b"})
    assert (config.topic, config.fps) == ("/b", 5.0)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"camra": "x"}, "nearest known key is 'camera'"),
        ({"tracker": {"horizon": 1}}, "nearest known key is 'tracker.horizon_s'"),
        ({"fps": "fast"}, "'fps' must be a number"),
        ({"fps": True}, "'fps' must be a number"),
        ({"tags": 3}, "'tags' must be a table"),
        ({"tags": {"which": "some"}}, "must be one of pad, all"),
        ({"tags": {"max_hamming": 1.5}}, "must be a whole number"),
        ({"save": 7}, "must be a list of names"),
        ({"scale_intrinsics": "yes"}, "must be true or false"),
    ],
)
def test_a_wrong_key_or_type_is_named(values: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as caught:
        configured(TrackConfig(), values)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    "values",
    [
        {"save": "gif"},
        {"camera": "a.yaml", "hfov_deg": 60},
        {"tags": {"family": "tag99"}},
        {"tags": {"tone": "bright"}},
        {"tags": {"min_margin": -1}},
        {"tracker": {"horizon_s": -1}},
        {"tags": {"which": "none"}},
    ],
)
def test_values_that_make_no_sense_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        configured(TrackConfig(), values)


def test_a_file_names_other_files_relative_to_itself(tmp_path: Path) -> None:
    (tmp_path / "cam.yaml").touch()
    file = tmp_path / "landtool.toml"
    file.write_text('camera = "cam.yaml"\nego = "/odometry"\n[tracker]\ncoast_s = 3\n')
    config = configured(TrackConfig(), read_config(file))
    assert config.camera == tmp_path / "cam.yaml"
    assert config.ego == "/odometry"
    assert config.tracker.coast_s == 3.0


def test_a_network_is_named_relative_to_the_file(tmp_path: Path) -> None:
    (tmp_path / "net.onnx").touch()
    file = tmp_path / "detect.toml"
    file.write_text('search = "region"\n[detector]\nmodel = "net.onnx"\nimgsz = [320, 256]\n[tags]\nwhich = "none"\n')
    config = configured(DetectConfig(), read_config(file))
    assert (config.detector.model, config.detector.imgsz) == (tmp_path / "net.onnx", (320, 256))
    assert (config.search, config.tags.which) == ("region", "none")


@pytest.mark.parametrize("values", [{"detector": {"conf": 2}}, {"detector": {"imgsz": [16, 480]}}, {"fps": 0}])
def test_numbers_of_a_detection_that_make_no_sense_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        configured(DetectConfig(), values)


def test_broken_and_missing_files(tmp_path: Path) -> None:
    with pytest.raises(UsageError):
        read_config(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("camera = ")
    with pytest.raises(InputError, match="no valid TOML"):
        read_config(tmp_path / "bad.toml")
