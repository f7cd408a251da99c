"""Facts of the text files a run takes: calibration, pad, mount, the drone's poses, settings; told apart by content."""

from __future__ import annotations

import math
import re
import shlex
import tomllib
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from landtool.camera import Camera
from landtool.config import TrackConfig, configured, read_config
from landtool.errors import InputError, LandtoolError, UsageError
from landtool.geometry import Array
from landtool.inspect.advice import Need, TrackAdvice, tag_range, track_command
from landtool.inspect.clock import measure_clock
from landtool.inspect.facts import Calibration, CameraFacts, Ego, Facts, Kind, Mount, Pad, PadTagFacts, Request
from landtool.inspect.facts import Settings as SettingsFacts
from landtool.inspect.recordings import given_options
from landtool.io.calibration import read_camera, read_cameras
from landtool.io.poses import CSV_COLUMNS, read_ego, read_mount
from landtool.io.tables import TABLES
from landtool.pad import PadSpec

MAX_BYTES = 1_000_000  # of what is looked at to tell the kind
_KINDS_HINT = "give a video, folder of images, MCAP log, calibration, pad, mount, poses (CSV, TUM) or settings file"
_RECORDING = "RECORDING"
_TRUTH_COLUMNS = ("camera_T_pad_", "world_T_pad_", "world_T_body_")  # beginnings of their names
_REPLACED = {"--camera": ("--camera", "--hfov")}  # beginnings of the options that a file given as this one excludes
_CAMERA = Need("--camera CAM.yaml", "the recording's calibration, if it is no log that holds it")

_CALIBRATION = re.compile(
    r"camera_?matrix|intrinsics|distortion_?coef|dist_?coeffs|camera_model|\"K\"\s*:|^K\s*:",
    re.IGNORECASE | re.MULTILINE,
)
_PAD_KEYS = {"diameter_m", "board", "ring", "letter", "quiet_zone", "tags"}
_SETTINGS_KEYS = {field.name for field in fields(TrackConfig)} - {"diameter_m", "tags"}


def read_text(path: Path) -> str | None:
    """Return the beginning of a text file, None when the file is none."""
    with path.open("rb") as file:
        data = file.read(MAX_BYTES)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if error.start < len(data) - 4 or len(data) < MAX_BYTES:  # else the limit cut a character
            return None
        text = data[: error.start].decode("utf-8-sig")
    return None if "\0" in text or not text.strip() else text


def inspect_file(path: Path, text: str, request: Request) -> Facts | None:
    """Tell what a text file holds; None when it is none of the kinds in `TEXT_KINDS`.

    Raises InputError and UsageError as the kind's own reader does.
    """
    kind = next((kind for kind in TEXT_KINDS if kind.recognises(text)), None)
    if kind is None:
        return None
    if request.topic is not None or request.fps is not None:
        raise UsageError("is no recording", file=path, hint="leave out --topic and --fps")
    return kind.inspect(path, request)


def unknown_text(path: Path, text: str) -> InputError:
    """Return the error for a text file of no known kind."""
    columns = _header(text)
    for name, table in TABLES.items():
        if columns == list(table.columns):
            hint = "give the recording it was made from"
            return InputError(f"is a table landtool wrote ({name})", file=path, hint=hint)
    if any(name.startswith(_TRUTH_COLUMNS) for name in columns):
        hint = "give the recording it is about, or the folder of both to `landtool eval --dataset`"
        return InputError("is the truth of a recording", file=path, hint=hint)
    return InputError("is text, and none of the files landtool reads", file=path, hint=_KINDS_HINT)


def _facts(
    path: Path,
    kind: Kind,
    format: str,
    facts: Calibration | Pad | Mount | Ego | SettingsFacts,
    use: str,
    request: Request,
) -> Facts:
    """Put a text file's facts together; `use`: how `landtool track` takes it, in place of what is given for it."""
    others = [option for option in given_options(request) if not option.startswith(_REPLACED.get(use, f"{use} "))]
    camera_is_known = kind in ("calibration", "settings") or request.camera or request.hfov_deg
    needs = () if camera_is_known else (_CAMERA,)
    given = [f"{use} {shlex.quote(str(path))}", *others]
    track = TrackAdvice(track_command(_RECORDING, given, needs), needs)
    return Facts(path, kind, format, path.stat().st_size, False, (), facts, track)


def _calibration(path: Path, request: Request) -> Facts:
    format, cameras = read_cameras(path)
    facts = Calibration(tuple(CameraFacts.of(camera, name) for name, camera in cameras.items()))
    made = _facts(path, "calibration", format, facts, "--camera", request)
    if len(cameras) < 2:
        return made
    if request.camera_name in cameras:
        track = TrackAdvice(f"{made.track.command} --camera-name {shlex.quote(request.camera_name)}")
        return replace(made, track=track)
    names = " or ".join(cameras)
    need = Need("--camera-name " + next(iter(cameras)), f"which of its {len(cameras)} cameras: {names}")
    track = TrackAdvice(f"{made.track.command} {need.option}", (need,))
    return replace(made, track=track)


def _pad(path: Path, request: Request) -> Facts:
    pad = PadSpec.read(path)
    camera = _pad_camera(request, path)
    mm = pad.diameter_m * 1000.0
    tags = tuple(
        PadTagFacts(t.family, t.id, pad.tag_size_m(t) * 1000.0, t.x * mm, t.y * mm, t.yaw_deg) for t in pad.tags
    )
    board, ring, letter, zone = pad.board, pad.ring, pad.letter, pad.quiet_zone
    facts = Pad(
        name=pad.name,
        diameter_mm=mm,
        extent_mm=pad.extent_m * 1000.0,
        board_mm=board.side * mm if board else None,
        ring_outer_mm=ring.outer * mm if ring else None,
        ring_inner_mm=ring.inner * mm if ring else None,
        letter_height_mm=letter.height * mm if letter else None,
        letter_width_mm=letter.width * mm if letter else None,
        letter_stroke_mm=letter.stroke * mm if letter else None,
        quiet_zone_mm=zone.side * mm if zone else None,
        tags=tags,
        camera=CameraFacts.of(camera) if camera else None,
        whole_from_m=_whole_from_m(pad, camera) if camera else None,
        ranges=tuple(tag_range(pad, tag, camera) for tag in pad.tags) if camera else (),
    )
    return _facts(path, "pad", "pad TOML", facts, "--pad", request)


def _pad_camera(request: Request, path: Path) -> Camera | None:
    """Return the camera a pad's ranges are asked for; a field of view alone says nothing without a size in pixels."""
    if request.camera:
        return read_camera(request.camera, request.camera_name)
    if request.hfov_deg is None:
        return None
    if request.size is None:
        raise UsageError("a field of view gives no range without a picture size", file=path, hint="pass --size WxH too")
    return Camera.from_hfov(*request.size, request.hfov_deg)


def _whole_from_m(pad: PadSpec, camera: Camera) -> float:
    # pinhole: size in px = f extent / distance
    return pad.extent_m * max(camera.fx / camera.width, camera.fy / camera.height)


def _mount(path: Path, request: Request) -> Facts:
    body_T_camera = read_mount(path)
    axis = body_T_camera.rotation @ (0.0, 0.0, 1.0)
    top = body_T_camera.rotation @ (0.0, -1.0, 0.0)
    off_down_deg = math.degrees(math.acos(float(np.clip(-axis[2], -1.0, 1.0))))
    place, turn = _tuple(body_T_camera.translation), _tuple(body_T_camera.quaternion_wxyz)
    return _facts(
        path, "mount", "mount TOML", Mount(place, turn, off_down_deg, _tuple(axis), _tuple(top)), "--mount", request
    )


def _ego(path: Path, request: Request) -> Facts:
    poses = read_ego(path)
    places = poses.positions_m
    way = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    clock = measure_clock(poses.t_ns.tolist(), "file")
    facts = Ego(len(poses.t_ns), clock, _tuple(places.min(axis=0)), _tuple(places.max(axis=0)), way)
    format = "CSV" if "," in _first_line(read_text(path) or "") else "TUM"
    return _facts(path, "ego", format, facts, "--ego", request)


def _settings(path: Path, request: Request) -> Facts:
    values = read_config(path)
    try:
        configured(TrackConfig(), values)
    except LandtoolError as error:
        raise type(error)(error.reason, file=error.file or path, hint=error.hint) from error
    return _facts(path, "settings", "settings TOML", SettingsFacts(_flat(values)), "--config", request)


def _flat(values: dict[str, object], where: str = "") -> dict[str, object]:
    flat: dict[str, object] = {}
    for key, value in values.items():
        flat |= _flat(value, f"{where}{key}.") if isinstance(value, dict) else {f"{where}{key}": value}
    return flat


def _tuple(values: Array) -> tuple[float, ...]:
    return tuple(round(float(value), 12) + 0.0 for value in values)  # + 0.0: no minus before a zero


def _toml_keys(text: str) -> set[str]:
    """Return the top-level keys of a TOML text, even of one that is not quite right."""
    try:
        return set(tomllib.loads(text))
    except tomllib.TOMLDecodeError:
        found = re.findall(r"^\s*(?:\[\[?\s*(\w+)[\w.\s]*\]?\]|(\w+)\s*=)", text, re.MULTILINE)
        return {table or key for table, key in found}


def _first_line(text: str) -> str:
    """Return the first line that is neither empty nor a comment."""
    lines = (line.strip() for line in text.splitlines())
    return next((line for line in lines if line and not line.startswith("#")), "")


def _header(text: str) -> list[str]:
    return [cell.strip().strip('"') for cell in _first_line(text).split(",")]


def _is_pad(text: str) -> bool:
    return bool(_toml_keys(text) & _PAD_KEYS)


def _is_ego(text: str) -> bool:
    """Tell a CSV with most of the columns, but none of landtool's own tables, or a TUM file: eight numbers a line."""
    columns = _header(text)
    if len(columns) > 1:
        return columns[0] != "frame" and len(set(columns) & set(CSV_COLUMNS)) > len(CSV_COLUMNS) / 2
    return re.fullmatch(r"([-+.\deE]+\s+){7}[-+.\deE]+", _first_line(text)) is not None


class TextKind(NamedTuple):
    """A kind of text file: a test of its text, and what tells its facts."""

    recognises: Callable[[str], bool]
    inspect: Callable[[Path, Request], Facts]


# The first that recognises the text reads it, and its errors count
TEXT_KINDS: tuple[TextKind, ...] = (
    TextKind(_is_ego, _ego),
    TextKind(lambda text: "body_T_camera" in _toml_keys(text), _mount),
    TextKind(lambda text: _CALIBRATION.search(text) is not None, _calibration),
    TextKind(lambda text: bool(_toml_keys(text) & _SETTINGS_KEYS), _settings),
    TextKind(_is_pad, _pad),
)
