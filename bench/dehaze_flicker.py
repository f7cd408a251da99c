"""How much a dehazed video flickers where the scene stands still."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np

from bench.dehaze_pairs import FOGGY, SEED
from bench.detect_sets import PAD, SIZE
from bench.show import table
from landtool.dehaze.config import DehazeConfig
from landtool.dehaze.stage import DehazeStage
from landtool.io.source import open_source
from landtool.io.video_out import VideoWriter
from landtool.synth.photograph import light_of, random_sensor
from landtool.synth.random_scene import draw_scene
from landtool.types import Frame, Image

FRAMES, FPS = 90, 30
SCENES = (1, 5, 3)  # by their number
LIGHT = 0.02  # a lamp's flicker, up and down
GOAL = 1.2
WAYS = {
    "veil": DehazeConfig(),
    "veil, smooth 0": DehazeConfig(smooth_s=0.0),
    "paper": DehazeConfig(recipe="paper"),
    "paper, smooth 0": DehazeConfig(recipe="paper", smooth_s=0.0),
}


def print_flicker() -> None:
    """Print the change of the mean brightness from frame to frame, of the output over that of the input."""
    rows = []
    for scene in SCENES:
        still = list(_clip(scene, 0.0))
        clips = {
            "sensor noise": still,
            "the same, through H.264": _through_h264(still),
            f"and light +-{100 * LIGHT:g} %": list(_clip(scene, LIGHT)),
        }
        for name, images in clips.items():
            own = _change(images)
            made = [_change(_dehazed(images, config)) for config in WAYS.values()]
            levels = [f"{change / (FRAMES - 1):.3f}" for change in (own, made[0])]
            rows.append([str(scene), name, *levels, *(f"{change / own:.2f}" for change in made)])
    title = f"A scene that stands still, {FRAMES} frames: change of the mean brightness from frame to frame"
    head = ["scene", "clip", "input, grey levels", "veil, grey levels", *WAYS]
    table(f"{title}, output over input; goal for veil: <= {GOAL:g}", head, rows)


def _clip(scene: int, flicker: float) -> Iterator[Image]:
    """Yield pictures of one foggy scene, the noise new in each, the light off by up to a share."""
    rng = np.random.default_rng([SEED, scene])
    drawn = draw_scene(FOGGY, PAD, SIZE, (), rng)
    linear, _ = light_of(drawn.scene, drawn.view)
    sensor = random_sensor(FOGGY, rng)
    for _ in range(FRAMES):
        yield sensor.picture(linear * np.float32(1.0 + flicker * rng.uniform(-1.0, 1.0)), rng)


def _through_h264(images: list[Image]) -> list[Image]:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "clip.mp4"
        with VideoWriter(file, *SIZE, fps=Fraction(FPS)) as video:
            for image in images:
                video.write(image, None)
        return [frame.image for frame in open_source(file) if isinstance(frame, Frame)]


def _dehazed(images: list[Image], config: DehazeConfig) -> list[Image]:
    stage = DehazeStage(config, when="on")
    return [stage.see(Frame(i, i * 1_000_000_000 // FPS, image)).image for i, image in enumerate(images)]


def _change(images: list[Image]) -> float:
    return float(np.abs(np.diff([image.mean() for image in images])).sum())
