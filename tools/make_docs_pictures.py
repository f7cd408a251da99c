"""Draw docs/pictures: the frames, the pad's axes, one annotated frame, generated pictures, and those of dehazing.

Run: `python tools/make_docs.py --pictures`.
"""

from __future__ import annotations

import importlib
import tempfile
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as PilImage

from landtool.camera import Camera
from landtool.config import TrackConfig
from landtool.geometry import Array, Pose
from landtool.io.poses import STRAIGHT_DOWN
from landtool.io.source import open_source
from landtool.pad import PadSpec
from landtool.run.tracking import track
from landtool.strokes import BLUE, GREEN, GREY, ORANGE, VERMILLION, WHITE, Color, Pen
from landtool.synth.dataset import DatasetRequest, write_dataset
from landtool.synth.domain import Domain
from landtool.synth.preview.facts import read_facts
from landtool.synth.preview.labels import labelled, read_labels
from landtool.synth.preview.sheet import contact_sheet
from landtool.synth.render import encode, render_pad
from landtool.types import Frame, Image

ROOT = Path(__file__).resolve().parent.parent
PICTURES = ROOT / "docs" / "pictures"
CLIP = ROOT / "datasets" / "fixtures" / "approach.mp4"
COLORS = 200  # of a PNG's palette: a photograph in few bytes
SHOWN_FRAME = 60
GROUND = (0.24, 0.25, 0.26)  # linear light, blue first
SHEET = (6, 4)  # columns and rows of generated pictures
CELL_PX = (192, 144)
SHEET_QUALITY = 82
SHEET_SEED = 6


def main() -> None:
    """Write all pictures."""
    PICTURES.mkdir(exist_ok=True)
    for name, image in (("frames", frames()), ("pad", pad_axes()), ("annotated", annotated())):
        # k-means: without it thin coloured lines lose their colour to the ground's many greys
        picture = PilImage.fromarray(image[:, :, ::-1]).quantize(COLORS, kmeans=2, dither=PilImage.Dither.NONE)
        picture.save(PICTURES / f"{name}.png", optimize=True)
    # a palette is too small for so many pictures
    sheet = PilImage.fromarray(generated()[:, :, ::-1])
    sheet.save(PICTURES / "generated.jpg", quality=SHEET_QUALITY, optimize=True)
    for beside in ("make_dehaze_pictures", "make_method_pictures"):
        importlib.import_module(beside).main()


def frames() -> Image:
    """Draw world, pad, body and camera from the side."""
    camera = Camera(760, 520, 700.0, 700.0, 379.5, 259.5)
    world_T_pad = Pose.from_rotvec((0.0, 0.0, 0.0), (0.0, 0.0, 0.35))
    world_T_body = Pose.from_rotvec((-0.25, 0.1, 1.5), (0.0, 0.0, 0.15))
    world_T_camera = world_T_body @ Pose(STRAIGHT_DOWN.rotation, np.array([0.1, 0.0, -0.12]))
    eye_T_world = _looking((-2.3, -2.3, 2.0), (-0.3, 0.05, 0.62)).inverse()
    image, pen = _scene(camera, eye_T_world @ world_T_pad)
    world_T_world = Pose.from_rotvec((-1.15, 0.55, 0.0), (0.0, 0.0, 0.0))
    _frustum(image, pen, camera, eye_T_world, world_T_camera)
    named = (
        ("world", world_T_world, 0.45, (-10, 26)),
        ("pad", world_T_pad, 0.55, (-10, 26)),
        ("body", world_T_body, 0.40, (-12, 22)),
        ("camera", world_T_camera, 0.28, (85, 36)),
    )
    for name, world_T_frame, length_m, beside_px in named:
        _axes(image, pen, camera, eye_T_world @ world_T_frame, length_m, name, beside_px)
    return image


def pad_axes() -> Image:
    """Draw the pad from above with its own axes and those of its tag."""
    camera = Camera(420, 420, 400.0, 400.0, 209.5, 209.5)
    # the top of the print at the top of the image: pad x up, y left
    camera_T_pad = Pose(STRAIGHT_DOWN.rotation.T, np.array([0.0, 0.0, 1.1]))
    image, pen = _scene(camera, camera_T_pad)
    pad = PadSpec()
    _axes(image, pen, camera, camera_T_pad, 0.46, "pad")
    camera_T_tag = camera_T_pad @ pad.pad_T_tag(pad.tags[0])
    for axis, label in ((0, "tag x"), (1, "tag y")):
        # beside the pad's own axes, which would cover them
        start = -0.03 * np.eye(3)[1 - axis]
        line = camera.project(camera_T_tag.apply(np.array([start, start + 0.2 * np.eye(3)[axis]])))
        pen.line(image, line, ORANGE)
        pen.label(image, label, line[1, 0] + 4, line[1, 1] + (0 if axis else 18), ORANGE, "left" if axis else "right")
    return image


def annotated() -> Image:
    """Track the shipped landing and return one frame of its annotated video."""
    config = TrackConfig(camera=CLIP.with_suffix(".camera.yaml"), ego=str(CLIP.with_suffix(".ego.csv")))
    with tempfile.TemporaryDirectory() as folder:
        outcome = track(CLIP, Path(folder) / "run", config)
        with open_source(outcome.folder / "annotated.mp4") as video:
            return next(f.image for f in video if isinstance(f, Frame) and f.index == SHOWN_FRAME)


def generated() -> Image:
    """Return a sheet of generated pictures with their labels, as `landtool generate` draws it."""
    columns, rows = SHEET
    request = DatasetRequest(columns * rows, SHEET_SEED, (640, 480), (0.8, 0.1, 0.1), Domain(), PadSpec())
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        dataset = write_dataset(request, Path(folder) / "set", preview=False).folder
        facts = read_facts(dataset)
        labels = read_labels(dataset, facts.files)
        pictures = [labelled(labels[f], c, *CELL_PX) for f, c in zip(facts.files, facts.tag_corners_px, strict=True)]
        return contact_sheet(pictures, columns, rows, *CELL_PX)


def _scene(camera: Camera, camera_T_pad: Pose) -> tuple[Image, Pen]:
    ground = np.full((camera.height, camera.width, 3), GROUND, np.float32)
    image = encode(render_pad(camera, camera_T_pad, PadSpec(), background=ground, light=0.75), blur_sigma_px=0.5)
    return image, Pen.of_image(camera.width, camera.height)


def _looking(from_m: tuple[float, float, float], at_m: tuple[float, float, float]) -> Pose:
    """Return world_T_eye of a camera at a place that looks at another, the world's z up in its image."""
    place = np.array(from_m)
    forward = np.array(at_m) - place
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return Pose(np.column_stack([right, np.cross(forward, right), forward]), place)


def _axes(
    image: Image,
    pen: Pen,
    camera: Camera,
    camera_T_frame: Pose,
    length_m: float,
    name: str,
    beside_px: tuple[int, int] = (-10, 26),
) -> None:
    for axis, color in enumerate((VERMILLION, GREEN, BLUE)):
        line = camera.project(camera_T_frame.apply(np.array([np.zeros(3), length_m * np.eye(3)[axis]])))
        if np.linalg.norm(line[1] - line[0]) < 3.0:  # it points at the viewer
            pen.disc(image, line[0], 3.0, color)
            continue
        pen.line(image, line, color)
        _label(image, pen, line, "xyz"[axis], color)
    origin = camera.project(camera_T_frame.apply(np.zeros((1, 3))))[0]
    pen.label(image, name, origin[0] + beside_px[0], origin[1] + beside_px[1], WHITE, "left")


def _label(image: Image, pen: Pen, line: Array, text: str, color: Color) -> None:
    way = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    at = line[1] + 11.0 * way
    pen.label(image, text, at[0], at[1] + pen.text_px / 2, color, "centre")


def _frustum(image: Image, pen: Pen, camera: Camera, eye_T_world: Pose, world_T_camera: Pose) -> None:
    """Draw what the camera sees: rays through the corners of its image, down to the ground."""
    corners = np.array([[-0.5, -0.375, 1.0], [0.5, -0.375, 1.0], [0.5, 0.375, 1.0], [-0.5, 0.375, 1.0]])
    centre = eye_T_world.apply(world_T_camera.translation[None])
    on_ground = world_T_camera.apply(corners * world_T_camera.translation[2])
    ends = camera.project(eye_T_world.apply(on_ground))
    for end in ends:
        pen.line(image, np.array([camera.project(centre)[0], end]), GREY)
    pen.line(image, ends, GREY, closed=True)


if __name__ == "__main__":
    main()
