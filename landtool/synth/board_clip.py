"""A film of a calibration board held before a known camera, to try `landtool calibrate` without a printer."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from landtool.calibrate.board import Board
from landtool.camera import COEFFICIENTS, Camera, DistortionModel
from landtool.errors import UsageError
from landtool.geometry import Pose, rotation_from_rotvec, rotvec_from_rotation
from landtool.io.atomic import atomic_path
from landtool.io.calibration import camera_yaml
from landtool.io.video_out import VideoWriter
from landtool.synth.board_view import Scene, board_pose, draw_board
from landtool.synth.sensor import Sensor
from landtool.types import Image

Lens = Literal["plumb_bob", "fisheye"]
LENSES: tuple[Lens, ...] = get_args(Lens)
BOUNDS = {"duration_s": (0.2, 600.0), "hfov_deg": (20.0, 150.0)}
SIDE_FILES = ("camera.yaml", "toml")
"""What lies beside `<name>.mp4`: the true camera and the board."""
_SUFFIXES = (".mp4", ".mov")
_HOLD_S = 0.45  # from one place to the next
_PLUMB_BOB_HFOV_DEG = 110.0  # a wider lens bends more than its polynomial can
_BEND = {"plumb_bob": (-0.24, 0.07, 0.0006, -0.0004, 0.0), "fisheye": (-0.015, 0.004, -0.002, 0.0003)}
_SENSOR = Sensor(psf_sigma_px=0.6, shot_variance=1e-4, read_variance=5e-6)


@dataclass(frozen=True)
class BoardClipConfig:
    """What to film. size: pixels of the pictures. Raises UsageError for what cannot be filmed."""

    board: Board = field(default_factory=Board)
    duration_s: float = 6.0
    fps: Fraction = Fraction(10)
    size: tuple[int, int] = (640, 480)
    hfov_deg: float = 65.0
    lens: Lens = "plumb_bob"
    seed: int = 0

    def __post_init__(self) -> None:
        if self.lens not in LENSES:
            raise UsageError(f"no lens '{self.lens}'", hint=f"known: {', '.join(LENSES)}")
        for name, (low, high) in BOUNDS.items():
            if not low <= getattr(self, name) <= high:
                raise UsageError(f"{name} = {getattr(self, name):g} is outside {low:g} to {high:g}")
        if not (self.fps > 0 and self.fps <= 240):
            raise UsageError(f"{self.fps} pictures a second", hint="above 0, at most 240")
        if not all(64 <= side <= 4096 for side in self.size):
            raise UsageError("pictures of {}x{}".format(*self.size), hint="64 to 4096 pixels each way")
        if self.lens == "plumb_bob" and self.hfov_deg > _PLUMB_BOB_HFOV_DEG:
            reason = f"a field of view of {self.hfov_deg:g} degrees is too wide for plumb_bob"
            raise UsageError(reason, hint="choose the fisheye lens")

    @property
    def frames(self) -> int:
        """How many pictures."""
        return max(1, round(self.duration_s * self.fps))

    @property
    def camera(self) -> Camera:
        """The true camera: its centre a little off the middle, its pixels a little off square, as real ones are."""
        width, height = self.size
        rng = np.random.default_rng([self.seed, 1])
        half = math.radians(self.hfov_deg) / 2.0
        f = width / 2.0 / (half if self.lens == "fisheye" else math.tan(half))
        cx, cy = (np.array(self.size) - 1) / 2.0 + rng.uniform(-0.012, 0.012, 2) * width
        model: DistortionModel = "equidistant" if self.lens == "fisheye" else "plumb_bob"
        bend = _BEND[self.lens][: COEFFICIENTS[model]]
        # a narrow lens bends less
        share = 1.0 if self.lens == "fisheye" else min(1.0, (self.hfov_deg / 65.0) ** 2)
        distortion = tuple(float(k) * share for k in bend)
        return Camera(width, height, f, f * 1.001, float(cx), float(cy), model, distortion)


def film_board(config: BoardClipConfig) -> Iterator[tuple[Image, Pose]]:
    """Yield the pictures with the board's true pose, camera_T_board. The same config gives the same pictures."""
    rng = np.random.default_rng([config.seed, 2])
    camera, scene = config.camera, Scene(config.board)
    whole = config.board.kind == "chessboard"
    places = [
        board_pose(config.board, camera, rng, whole=whole) for _ in range(math.ceil(config.duration_s / _HOLD_S) + 2)
    ]
    for index in range(config.frames):
        at = float(index / config.fps) / _HOLD_S
        first = int(at)
        # slow at each place and quick between them
        way = at - first
        pose = _between(places[first], places[first + 1], way * way * (3.0 - 2.0 * way))
        yield draw_board(scene, camera, pose, _SENSOR, rng), pose


def _between(a: Pose, b: Pose, share: float) -> Pose:
    turn = rotvec_from_rotation(b.rotation @ a.rotation.T)
    rotation = rotation_from_rotvec(share * turn) @ a.rotation
    return Pose(rotation, (1.0 - share) * a.translation + share * b.translation)


def side_files(path: Path) -> dict[str, Path]:
    """Return the files beside a film by their endings, `SIDE_FILES`."""
    return {ending: path.with_suffix(f".{ending}") for ending in SIDE_FILES}


def write_board_clip(
    config: BoardClipConfig,
    path: Path,
    *,
    overwrite: bool = False,
    report: Callable[[int, int], None] | None = None,
) -> Camera:
    """Film a board and write it to `path`, .mp4 or .mov, its true camera and the board beside it, all or none.

    Returns the true camera. report: gets pictures done and in all. Raises UsageError for another ending,
    OutputExistsError and OutputError as `atomic_path` does.
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise UsageError("is no kind of film", file=path, hint=f"end its name in {' or '.join(_SUFFIXES)}")
    beside = side_files(path)
    camera = config.camera
    with ExitStack() as files:
        truth, board = (files.enter_context(atomic_path(beside[e], overwrite=overwrite)) for e in SIDE_FILES)
        clip = files.enter_context(atomic_path(path, overwrite=overwrite))
        truth.write_text(camera_yaml(camera), encoding="utf-8")
        board.write_text(config.board.to_toml(), encoding="utf-8")
        with VideoWriter(clip, *config.size, fps=config.fps) as video:
            for done, (image, _) in enumerate(film_board(config), start=1):
                video.write(image, None)
                if report is not None:
                    report(done, config.frames)
    return camera
