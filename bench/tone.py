"""The gauge of the tone curve against known curves, and what the curve costs the pose."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from bench.show import table
from landtool.camera import Camera
from landtool.geometry import Pose, rotation_from_rotvec
from landtool.io.calibration import read_camera
from landtool.io.poses import STRAIGHT_DOWN
from landtool.io.source import open_source
from landtool.pad import PadSpec
from landtool.synth.render import encode, render_pad
from landtool.tags.pose import pad_corners, pad_solutions
from landtool.tags.reader import ReaderConfig, TagReader
from landtool.target.refine import refine_on_edges
from landtool.target.tone_gauge import ToneEstimate, ToneGauge
from landtool.tone import Tone, decode
from landtool.tone import encode as encode_tone
from landtool.types import Frame, Image

ROOT = Path(__file__).resolve().parents[1]
CLIP = ROOT.parent / "shared" / "data" / "rendered" / "clips" / "clip2_stop_and_go.mp4"
CAMERA = Camera(640, 480, 554.0, 554.0, 319.5, 239.5)
PAD = PadSpec()
TONES: tuple[Tone, ...] = ("none", 1.4, 1.8, "srgb", 2.2, 2.6)
DISTANCES_M = (2.0, 4.0, 6.0)
VIEWS = 12  # a distance
BLURS_PX = (0.4, 0.7, 1.0)
SEED = 11
POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")  # columns of a truth table

Shot = tuple[Image, Camera, PadSpec, Pose]


def main() -> None:
    """Print what is found of known curves, and the range errors by the wrong, the gauged and the true curve."""
    rows = [_row(str(tone), str(blur), tone, list(_rendered(tone, blur))) for tone in TONES for blur in BLURS_PX]
    _print("Pictures of our renderer, noise of 3 levels", "blur px", rows)
    if CLIP.exists():
        shots = list(_path_traced())
        rows = [_row(str(tone), "-", tone, [_retoned(shot, tone) for shot in shots]) for tone in TONES]
        _print("Path-traced clip, its sRGB curve replaced", "-", rows)
    _generated()


def _print(title: str, second: str, rows: list[list[str]]) -> None:
    head = ["true curve", second, "frames", "gamma", "blur px", "tone", "settled"]
    head += [f"range error by {name}, %" for name in ("srgb", "the gauge's", "the true one")]
    table(title, head, rows)


def _row(name: str, second: str, true: Tone, shots: list[Shot]) -> list[str]:
    found = _gauged(shots)
    used = found.tone if found is not None and found.is_settled else "srgb"
    return [name, second, *_cells(found), *(_range_error(shots, tone) for tone in ("srgb", used, true))]


def _cells(found: ToneEstimate | None) -> list[str]:
    if found is None:
        return ["0", "-", "-", "-", "-"]
    gamma = f"{found.gamma:.2f} +- {found.sigma_gamma:.2f}"
    return [str(found.frames), gamma, f"{found.blur_px:.2f}", str(found.tone), "yes" if found.is_settled else "no"]


def _gauged(shots: Iterable[Shot]) -> ToneEstimate | None:
    gauge = None
    for image, camera, pad, truth in shots:
        gauge = gauge or ToneGauge(pad, camera, "srgb")
        pose = _pose((image, camera, pad, truth), "srgb")
        for _ in range(3 if pose is not None else 0):  # it takes every third
            assert pose is not None
            gauge.add(image, pose)
    return gauge.estimate() if gauge else None


def _pose(shot: Shot, tone: Tone) -> Pose | None:
    """Return the pose of tag and edges; which of the two mirror poses is not the question here."""
    image, camera, pad, truth = shot
    corners = pad_corners(TagReader(ReaderConfig.of_pad(pad, tone=tone)).read_frame(image), camera, pad)
    if corners is None:
        return None
    start = min(pad_solutions(corners), key=lambda solution: solution.camera_T_pad.angle_to(truth))
    refined = refine_on_edges(image, corners, start, pad, tone)
    return (refined or start).camera_T_pad


def _range_error(shots: list[Shot], tone: Tone) -> str:
    poses = [(_pose(shot, tone), shot[3]) for shot in shots]
    off = [100.0 * abs(pose.translation[2] / truth.translation[2] - 1.0) for pose, truth in poses if pose is not None]
    return f"{np.median(off):.3f}" if off else "-"


def _rendered(tone: Tone, blur_px: float) -> Iterator[Shot]:
    rng = np.random.default_rng(SEED)
    ground = np.full((CAMERA.height, CAMERA.width, 3), 0.2, np.float32)
    for distance_m in DISTANCES_M:
        for _ in range(VIEWS):
            pose = _view(distance_m, rng)
            light = np.asarray(0.8 * render_pad(CAMERA, pose, PAD, background=ground), np.float32)
            curve = "linear" if tone == "none" else tone
            yield encode(light, blur_sigma_px=blur_px, noise_sigma=3.0, rng=rng, curve=curve), CAMERA, PAD, pose


def _view(distance_m: float, rng: np.random.Generator) -> Pose:
    tilt, azimuth, yaw = np.radians(rng.uniform(2.0, 20.0)), *rng.uniform(0.0, 2.0 * np.pi, 2)
    tilted = rotation_from_rotvec(tilt * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
    turn = tilted @ STRAIGHT_DOWN.rotation.T @ rotation_from_rotvec([0.0, 0.0, yaw])
    return Pose(turn, np.array([0.0, 0.0, distance_m]))


def _path_traced() -> Iterator[Shot]:
    with CLIP.with_suffix(".csv").open() as file:
        truth = list(csv.DictReader(file))
    fx, fy, cx, cy = (float(truth[0][c]) for c in ("fx", "fy", "cx", "cy"))
    camera = Camera(640, 480, fx, fy, cx, cy)
    for frame in open_source(CLIP):
        if isinstance(frame, Frame):
            row = truth[frame.index]
            place, turn = ([float(row[c]) for c in names] for names in (("tx", "ty", "tz"), ("qw", "qx", "qy", "qz")))
            yield frame.image, camera, PAD, Pose.from_quaternion(place, turn)


def _retoned(shot: Shot, tone: Tone) -> Shot:
    values = encode_tone(decode(np.arange(256) / 255.0, "srgb"), tone)
    return np.rint(255.0 * values).astype(np.uint8)[shot[0]], *shot[1:]


def _generated() -> None:
    """What is found of the shipped clips, whose cameras differ."""
    rows = []
    for path in sorted((ROOT / "datasets" / "fixtures").glob("*.truth.csv")):
        clip = path.with_suffix("").with_suffix(".mp4")
        if clip.exists():
            found = _gauged(_shipped(clip, path))
            rows.append([clip.stem, *_cells(found)])
    table("Shipped clips", ["clip", "frames", "gamma", "blur px", "tone", "settled"], rows)


def _shipped(clip: Path, truth_file: Path) -> Iterator[Shot]:
    with truth_file.open() as file:
        truth = list(csv.DictReader(file))
    camera, pad = read_camera(clip.with_suffix(".camera.yaml")), PadSpec.read(clip.with_suffix(".pad.toml"))
    for frame in open_source(clip):
        if isinstance(frame, Frame) and frame.index % 3 == 0:
            values = [float(truth[frame.index][f"camera_T_pad_{c}"]) for c in POSE]
            yield frame.image, camera, pad, Pose.from_quaternion(values[:3], values[3:])
