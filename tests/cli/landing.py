"""A short rendered landing, and the ways it may have been recorded."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Literal

import av
import cv2
import numpy as np

from landtool.camera import Camera
from landtool.io.calibration import write_camera
from landtool.io.mcap_out import McapImageWriter
from landtool.io.video_out import VideoWriter
from landtool.pad import PadSpec
from landtool.synth.render import encode, render_pad
from landtool.synth.texture import pad_texture
from landtool.types import Frame, Image
from tests.approach import Approach

CAMERA = Camera(320, 240, 300.0, 300.0, 161.0, 118.0)
APPROACH = Approach(duration_s=1.0, height_start_m=2.5, height_end_m=2.0, speed_mps=1.0, sway_rad=0.03)
TICK = Fraction(1, 15360)
TICKS = (0, 512, 1024, 1900, 2560, 3072, 3584, 4096, 4608, 5632, 6144, 6656, 7168, 7680)  # at no fixed rate
TIMES_NS = tuple(round(tick * TICK * 10**9) for tick in TICKS)
EPOCH_NS = 1_700_000_000_000_000_000


@dataclass(frozen=True, eq=False)
class Landing:
    """The pictures, and a folder with clip.mp4 and its camera.yaml."""

    folder: Path
    pictures: tuple[Image, ...]

    def video(self, path: Path, *, times: int = 1) -> Path:
        """Write a video of the pictures, over again `times` times, with its index at its end."""
        with VideoWriter(path, CAMERA.width, CAMERA.height, TICK) as writer:
            for turn in range(times):
                for tick, image in zip(TICKS, self.pictures, strict=True):
                    writer.write(image, round((tick + 8192 * turn) * TICK * 10**9))
        return path

    def remuxed(self, path: Path, muxer: dict[str, str] | None = None, *, rotation_deg: int = 0, gop: int = 4) -> Path:
        """Write the pictures with FFmpeg's own muxer, stored turned so that `rotation_deg` makes them upright."""
        pictures = [np.rot90(image, -rotation_deg // 90) for image in self.pictures]
        with av.open(str(path), "w", options=muxer or {}) as container:
            stream = container.add_stream("libx264", rate=30, options={"crf": "15"})
            stream.height, stream.width = pictures[0].shape[:2]
            stream.pix_fmt, stream.time_base, stream.codec_context.gop_size = "yuv420p", TICK, gop
            stream.codec_context.time_base = TICK
            stream.codec_context.max_b_frames = 0
            if rotation_deg:
                stream.set_display_rotation(rotation_deg)
            for tick, image in zip(TICKS, pictures, strict=True):
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="bgr24")
                frame.pts, frame.time_base = tick, TICK
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))
        return path

    def log(self, path: Path, *, camera: Camera | None = CAMERA, schema: Literal["ros2", "foxglove"] = "ros2") -> Path:
        """Write an MCAP log of raw pictures, which takes several chunks."""
        with McapImageWriter(
            path, schema=schema, topic="/camera/image_raw", frame_id="camera", camera=camera, encoding="raw"
        ) as writer:
            for index, image in enumerate(self.pictures):
                writer.write(Frame(index, EPOCH_NS + TIMES_NS[index], image))
        return path

    def images(self, folder: Path, count: int = 4) -> Path:
        """Write a folder of img0.png, img1.png, ..."""
        folder.mkdir()
        for index, image in enumerate(self.pictures[:count]):
            assert cv2.imwrite(str(folder / f"img{index}.png"), image)
        return folder


def record(folder: Path) -> Landing:
    """Render the landing and write its first recording."""
    rng = np.random.default_rng(2)
    texture, ground = pad_texture(PadSpec()), np.full((CAMERA.height, CAMERA.width, 3), 0.12, np.float32)
    poses = [APPROACH.camera_T_pad(t_ns * 1e-9) for t_ns in TIMES_NS]
    seen = [render_pad(CAMERA, pose, texture, background=ground) for pose in poses]
    landing = Landing(folder, tuple(encode(light, blur_sigma_px=0.5, noise_sigma=2.0, rng=rng) for light in seen))
    landing.video(folder / "clip.mp4")
    write_camera(CAMERA, folder / "camera.yaml")
    return landing


def zeroed(path: Path, start: float, share: float = 0.1) -> Path:
    """Set a share of a file's bytes to zero, from a share of it on."""
    data = bytearray(path.read_bytes())
    first, count = int(len(data) * start), int(len(data) * share)
    data[first : first + count] = bytes(count)
    path.write_bytes(bytes(data))
    return path


def cut(path: Path, share: float) -> Path:
    """Keep only the first share of a file."""
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    return path


def snapshot(folder: Path, without: Sequence[str] = ()) -> dict[str, str]:
    """Return what is in a folder, hidden names too: kind and content of every path."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "no file"
        for path in sorted(folder.rglob("*"))
        if not set(path.relative_to(folder).parts) & set(without)
    }
