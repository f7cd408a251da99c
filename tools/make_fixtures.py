"""Make datasets/fixtures: one landing as video and as MCAP, with its exact truth. Run: `make fixtures`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Pose
from landtool.io.atomic import atomic_path
from landtool.io.calibration import write_camera
from landtool.io.mcap_out import McapImageWriter
from landtool.io.poses import CSV_COLUMNS
from landtool.io.tables import format_cell
from landtool.io.video_out import VideoWriter
from landtool.pad import PadSpec
from landtool.synth.ground import make_ground, render_scene
from landtool.synth.motion import Approach
from landtool.synth.render import encode
from landtool.types import Frame

FIXTURES = Path(__file__).parent.parent / "datasets" / "fixtures"
SEED = 5
FPS = 30
CAMERA = Camera(640, 480, 554.0, 554.0, 321.3, 238.6, distortion=(-0.12, 0.05, 0.0004, -0.0003, 0.0))
LANDING = Approach(
    duration_s=4.0,
    height_start_m=6.0,
    height_end_m=0.8,
    speed_mps=1.0,
    turn_rate_radps=0.15,
    lateral_start_m=(0.5, -0.4),
    lateral_decay_s=1.5,
    sway_rad=math.radians(4.0),
    sway_period_s=2.4,
    yaw_rad=0.35,
)
POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
TRUTH_COLUMNS = ("frame", "t_ns", *(f"{a}_T_{b}_{c}" for a, b in (("camera", "pad"), ("world", "pad")) for c in POSE))


def frames() -> Iterator[Frame]:
    """Render the landing, frame by frame."""
    rng = np.random.default_rng(SEED)
    ground, pad = make_ground("asphalt", rng), PadSpec()
    for index in range(round(LANDING.duration_s * FPS)):
        t_s = index / FPS
        light = render_scene(
            CAMERA, LANDING.camera_T_pad(t_s), pad, ground, camera_T_ground=LANDING.camera_T_ground(t_s), light=0.75
        )
        image = encode(light, blur_sigma_px=0.6, noise_sigma=2.0, rng=rng)
        yield Frame(index, round(Fraction(index * 1_000_000_000, FPS)), image)


def main() -> None:
    """Write every fixture, replacing the old ones."""
    FIXTURES.mkdir(parents=True, exist_ok=True)
    clip, log = FIXTURES / "approach.mp4", FIXTURES / "approach.mcap"
    stamps: list[int] = []
    with (
        atomic_path(clip, overwrite=True) as video_path,
        atomic_path(log, overwrite=True) as log_path,
        VideoWriter(video_path, CAMERA.width, CAMERA.height, Fraction(1, 15360)) as video,
        McapImageWriter(
            log_path,
            schema="foxglove",
            topic="/camera/image",
            frame_id="camera",
            camera=CAMERA,
            encoding="h264",
        ) as mcap,
    ):
        for frame in frames():
            video.write(frame.image, frame.t_ns)
            mcap.write(frame)
            stamps.append(frame.t_ns or 0)
    write_camera(CAMERA, FIXTURES / "approach.camera.yaml", overwrite=True)
    _write_truth(stamps)
    _write_ego()


def _write_truth(stamps: list[int]) -> None:
    with atomic_path(FIXTURES / "approach.truth.csv", overwrite=True) as path:
        lines = [",".join(TRUTH_COLUMNS)]
        for index, t_ns in enumerate(stamps):
            t_s = index / FPS
            poses = (LANDING.camera_T_pad(t_s), LANDING.world_T_pad(t_s))
            cells = [index, t_ns, *(value for pose in poses for value in _cells(pose))]
            lines.append(",".join(map(format_cell, cells)))
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _write_ego() -> None:
    """The drone's own poses at 50 Hz, beginning before the clip and ending after it."""
    with atomic_path(FIXTURES / "approach.ego.csv", overwrite=True) as path:
        lines = [",".join(CSV_COLUMNS)]
        for step in range(-5, round(LANDING.duration_s * 50) + 6):
            world_T_body, _ = LANDING.pose_at(step / 50)
            lines.append(",".join(map(format_cell, [step * 20_000_000, *_cells(world_T_body)])))
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _cells(pose: Pose) -> list[float]:
    return [float(v) for v in (*pose.translation, *pose.quaternion_wxyz)]


if __name__ == "__main__":
    main()
