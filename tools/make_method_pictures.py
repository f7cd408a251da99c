"""Draw docs/pictures/method-*: one landing in fog, and what happens inside of it.

`python tools/make_docs.py --pictures` draws them with all others; `python tools/make_method_pictures.py` alone. The
clip is generated and tracked, which takes some two minutes.
"""

from __future__ import annotations

import csv
import math
import tempfile
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image as PilImage

from landtool.camera import Camera
from landtool.config import TrackConfig
from landtool.geometry import Array, Pose
from landtool.io.calibration import read_camera
from landtool.io.source import open_source
from landtool.landing.measure import mirrored
from landtool.pad import PadSpec
from landtool.report.page import COLORS as METHOD_COLORS
from landtool.run.tracking import track
from landtool.strokes import BLUE, DARK, ORANGE, SKY, VERMILLION, WHITE, YELLOW, Color, Pen
from landtool.synth.preview.sheet import contact_sheet, fitted
from landtool.target.letter import find_letter
from landtool.target.patch import Patch, cut_patch, on_print
from landtool.target.print_model import FINE, Plane, blur_kernel, print_of, texture_level, to_pixels
from landtool.target.register import Registered, register_target
from landtool.target.ring import fit_ring
from landtool.target.start import start_poses
from landtool.types import Frame, Image
from landtool_cli.main import run

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "pictures"
GENERATED = "--scenario straight --duration 16 --fps 30 --height 20 --fog 0.06 --seed 616 --quiet"
STRIP_M, STRIP_CELL_PX, STRIP_QUALITY = (20.0, 14.0, 9.0, 6.0, 3.0, 1.0), (400, 300), 72
REGISTERED_M, START_M, NORMAL_M, MIRROR_M, MIRROR_TILT_DEG = (18.0, 15.0, 9.0), 9.0, 2.5, 15.0, 12.0
PATCH_PX = 84.0  # as landtool.target.register has it
TILE_PX, HEAD_PX = 260, 24
COLORS, PHOTO_COLORS, PAGE_COLORS = 64, 160, 40
PAGE_WIDTH_PX = 1100


@dataclass(frozen=True)
class Landing:
    """A tracked clip. frames, truth, poses (None where there is none), boxes of the pad: one a frame."""

    folder: Path
    camera: Camera
    pad: PadSpec
    frames: list[Frame]
    truth: list[Pose]
    poses: list[dict[str, str] | None]
    boxes: list[Array | None]

    def at(self, distance_m: float) -> int:
        """Return the first frame this near to the pad."""
        return next(i for i, pose in enumerate(self.truth) if np.linalg.norm(pose.translation) <= distance_m)


def main() -> None:
    """Write all pictures, and print the verdict on the landing."""
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        landing = landed(Path(folder))
        strip = PilImage.fromarray(annotated_strip(landing)[:, :, ::-1])
        strip.save(PICTURES / "method-landing.jpg", quality=STRIP_QUALITY, optimize=True)
        for name, image, colors in (
            ("registration", PilImage.fromarray(registrations(landing)[:, :, ::-1]), COLORS),
            ("start", PilImage.fromarray(starts(landing)[:, :, ::-1]), PHOTO_COLORS),
            ("mirror", mirror_sketch(landing.camera, landing.pad), COLORS),
            ("error", error_chart(landing), COLORS),
        ):
            _save(image, name, colors)
        page = PilImage.open(landing.folder / "track.png").convert("RGB")
        height = round(page.height * PAGE_WIDTH_PX / page.width)
        _save(page.resize((PAGE_WIDTH_PX, height), PilImage.Resampling.LANCZOS), "page", PAGE_COLORS)


def _save(image: PilImage.Image, name: str, colors: int) -> None:
    made = image.quantize(colors, kmeans=2, dither=PilImage.Dither.NONE)
    made.save(PICTURES / f"method-{name}.png", optimize=True)


def landed(folder: Path) -> Landing:
    """Generate the clip and track it."""
    clip = folder / "landing.mp4"
    assert run(["generate", "clip", "-o", str(clip), *GENERATED.split()]) == 0
    camera, pad = clip.with_suffix(".camera.yaml"), clip.with_suffix(".pad.toml")
    config = TrackConfig(camera=camera, pad=pad, ego=str(clip.with_suffix(".ego.csv")))
    outcome = track(clip, folder / "run", config)
    print("\n".join(outcome.summary.lines()))  # as README.md shows them
    done = outcome.folder
    with open_source(clip) as source:
        frames = [frame for frame in source if isinstance(frame, Frame)]
    truth = [_pose(row, "camera_T_pad_") for row in _rows(clip.with_suffix(".truth.csv"))]
    poses: list[dict[str, str] | None] = [None] * len(frames)
    for row in _rows(done / "poses.csv"):
        poses[int(row["frame"])] = row
    boxes: list[Array | None] = [None] * len(frames)
    for row in _rows(done / "detections.csv"):
        if row["label"] == "pad":
            boxes[int(row["frame"])] = np.array(
                [float(row[k]) for k in ("x_min_px", "y_min_px", "x_max_px", "y_max_px")]
            )
    return Landing(done, read_camera(camera), PadSpec.read(pad), frames, truth, poses, boxes)


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _pose(row: dict[str, str], prefix: str = "") -> Pose:
    x, y, z, *quaternion = (float(row[prefix + key]) for key in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"))
    return Pose.from_quaternion(np.array([x, y, z]), np.array(quaternion))


# --- the landing ---------------------------------------------------------------------------------------------------


def annotated_strip(landing: Landing) -> Image:
    """Return frames of the annotated video, each with its distance."""
    wanted = {landing.at(distance_m + 0.02): distance_m for distance_m in STRIP_M}
    cells: list[Image] = []
    with open_source(landing.folder / "annotated.mp4") as video:
        for frame in video:
            if isinstance(frame, Frame) and frame.index in wanted:
                cell = fitted(frame.image, *STRIP_CELL_PX)[0]
                pen = Pen.of_image(*STRIP_CELL_PX)
                pen.label(cell, f"{wanted[frame.index]:g} m", STRIP_CELL_PX[0], STRIP_CELL_PX[1], WHITE, "left")
                cells.append(cell)
    return contact_sheet(cells, 3, 2, *STRIP_CELL_PX)


# --- the registration ----------------------------------------------------------------------------------------------


def registrations(landing: Landing) -> Image:
    """Return for some distances: the picture about the pad, the fitted print, and what is left, one row each."""
    rows = []
    for distance_m in REGISTERED_M:
        frame = landing.at(distance_m)
        image, start = landing.frames[frame].image, landing.truth[frame]
        found = register_target(image, landing.camera, start, landing.pad)
        assert found is not None
        patch = cut_patch(image, landing.camera, found.camera_T_pad, landing.pad, "srgb", PATCH_PX)
        assert patch is not None
        model, white, black = _fitted_print(patch, found, landing.pad)
        left = 0.5 + (patch.light - model) / (2.0 * black)
        tiles = [_tile(_seen(patch.light, white)), _tile(_seen(model, white)), _tile(left)]
        across = landing.camera.fx * landing.pad.diameter_m / distance_m
        Pen.of_image(480, 480).label(tiles[0], f"{distance_m:g} m, ring {across:.0f} px", 0, TILE_PX, DARK)
        rows.append(np.concatenate(tiles, axis=1))
    head = np.full((HEAD_PX, rows[0].shape[1], 3), WHITE, np.uint8)
    for column, name in enumerate(("the picture, linear light", "the print as fitted", "difference, grey is none")):
        Pen.of_image(480, 480).text(head, name, column * TILE_PX + 6, HEAD_PX - 7, DARK)
    return np.concatenate([head, *rows])


def _fitted_print(patch: Patch, found: Registered, pad: PadSpec) -> tuple[Plane, float, float]:
    """Return the print drawn at the pose found, in the light that suits the patch best, and its white and black."""
    what = print_of(pad, "srgb", in_parts=True)
    assert what is not None
    assert pad.ring is not None
    pose, radius_m = found.camera_T_pad, pad.ring.outer * pad.diameter_m / 2.0
    scale = math.sqrt(abs(float(np.linalg.det(patch.px_by_flat)))) / float(pose.translation[2])
    texture, texel = texture_level(what, FINE * radius_m * scale, 0.75)
    x, y = on_print(patch.fine, pose)
    column, row = (np.asarray(-axis / (radius_m * texel) + len(texture) / 2.0 - 0.5, np.float32) for axis in (y, x))
    sharp = cv2.remap(texture, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=(0, 0, 0))
    fine = np.asarray(cv2.filter2D(sharp, -1, blur_kernel(found.blur_px2 / patch.shrink**2)), np.float32)
    dark, cover, ring = to_pixels(fine).reshape(-1, 3).astype(np.float64).T
    px, py = (axis.ravel().astype(np.float64) / radius_m for axis in on_print(patch.middle, pose))
    side = np.where(np.abs(py) > np.abs(px), np.where(py > 0.0, 0, 1), np.where(px > 0.0, 2, 3))
    bright, beyond = cover - dark - ring, 1.0 - cover
    parts = [cover, bright * py, bright * px, -dark, -ring, *(beyond * (side == s) for s in range(4))]
    lights, *_ = np.linalg.lstsq(np.stack(parts, axis=1), patch.light.ravel().astype(np.float64), rcond=None)
    model = np.asarray((lights @ np.stack(parts)).reshape(patch.light.shape), np.float32)
    return model, float(lights[0]), float(lights[3])


def _seen(light: Plane, white: float) -> Plane:
    """Return light as a screen shows it, a little room above white."""
    return np.asarray(np.clip(light / (1.15 * white), 0.0, 1.0) ** (1.0 / 2.2), np.float32)


def _tile(values: Plane) -> Image:
    """Return a square picture of values in [0, 1], its pixels to be seen."""
    grey = np.clip(values * 255.0, 0, 255).astype(np.uint8)
    side = max(grey.shape)
    square = np.full((side, side), 128, np.uint8)
    top, left = (side - grey.shape[0]) // 2, (side - grey.shape[1]) // 2
    square[top : top + grey.shape[0], left : left + grey.shape[1]] = grey
    tile = cv2.resize(square, (TILE_PX, TILE_PX), interpolation=cv2.INTER_NEAREST)
    return np.asarray(cv2.cvtColor(tile, cv2.COLOR_GRAY2BGR), np.uint8)


# --- the start -----------------------------------------------------------------------------------------------------


def starts(landing: Landing) -> Image:
    """Return the way from a box to poses: the network's box, ring and letter, the two poses with their normals."""
    frame = next(i for i in range(landing.at(START_M), len(landing.frames)) if landing.boxes[i] is not None)
    image, box = landing.frames[frame].image, landing.boxes[frame]
    assert box is not None
    ring = fit_ring(image, box, landing.pad)
    assert ring is not None
    letter = find_letter(image, ring.ellipse, landing.pad)
    assert letter is not None
    middle, half = (box[:2] + box[2:]) / 2.0, 0.75 * float((box[2:] - box[:2]).max())
    corner, size = np.floor(middle - half), math.ceil(2.0 * half)
    scale = TILE_PX / size
    x0, y0 = corner.astype(int)
    tile = cv2.resize(image[y0 : y0 + size, x0 : x0 + size], (TILE_PX, TILE_PX), interpolation=cv2.INTER_NEAREST)
    tiles = [np.array(tile, np.uint8) for _ in range(3)]
    pen = Pen.of_image(TILE_PX, TILE_PX)

    def draw(number: int, points: Array, color: Color, *, closed: bool = False) -> None:
        pen.line(tiles[number], (points - corner + 0.5) * scale - 0.5, color, closed=closed)

    draw(0, np.array([box[[0, 1]], box[[2, 1]], box[[2, 3]], box[[0, 3]]]), SKY, closed=True)
    ellipse, angle = ring.ellipse, np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
    other = math.sqrt(1.0 - ellipse.slant**2)
    root = np.array([[ellipse.sx_px, 0.0], [ellipse.slant * ellipse.sy_px, other * ellipse.sy_px]])
    centre = np.array([ellipse.cx_px, ellipse.cy_px])
    draw(1, centre + np.column_stack([np.cos(angle), np.sin(angle)]) @ root.T, YELLOW, closed=True)
    c, s = math.cos(letter.turn_rad), math.sin(letter.turn_rad)
    axes = root @ np.array([[c, -s], [s, c]])
    for axis, color in ((0, ORANGE), (1, BLUE)):
        draw(1, centre + np.outer([-1.0, 1.0], axes[:, axis]), color)
    for pose, color in zip(start_poses(image, landing.camera, box, landing.pad), (VERMILLION, BLUE), strict=False):
        draw(2, landing.camera.project(pose.apply(landing.pad.outline_m)), color, closed=True)
        draw(2, landing.camera.project(pose.apply(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, NORMAL_M]]))), color)
    head = np.full((HEAD_PX, 3 * TILE_PX, 3), WHITE, np.uint8)
    for column, name in enumerate(("the network's box", "ring and letter", "two poses, their normals")):
        Pen.of_image(480, 480).text(head, name, column * TILE_PX + 6, HEAD_PX - 7, DARK)
    return np.concatenate([head, np.concatenate(tiles, axis=1)])


# --- drawings ------------------------------------------------------------------------------------------------------


def mirror_sketch(camera: Camera, pad: PadSpec) -> PilImage.Image:
    """Return a pad and its mirror image from the side, and as the camera sees both."""
    figure = Figure(figsize=(8.4, 3.6), dpi=100)
    FigureCanvasAgg(figure)  # or saving would ask for the window system
    side, seen = figure.subplots(1, 2, gridspec_kw={"left": 0.02, "right": 0.97, "top": 0.88, "bottom": 0.14})
    _draw_side(side)
    tilt = math.radians(MIRROR_TILT_DEG)
    # x right, y down, z forward: a pad below, turned about the image's x by the tilt
    flat = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    turn = Pose.from_rotvec((0.0, 0.0, 0.0), (tilt, 0.0, 0.0)).rotation
    true = Pose(turn @ flat, np.array([0.0, 0.0, MIRROR_M]))
    other = mirrored(true)
    apart = 0.0
    for pose, color, name in ((true, "#0072b2", "the pad"), (other, "#d55e00", "its mirror image")):
        place = camera.project(pose.apply(pad.outline_m))
        middle = camera.project(pose.translation[None])[0]
        outline = np.concatenate([place, place[:1]]) - middle
        seen.plot(outline[:, 0], -outline[:, 1], color=color, label=name, linewidth=1.2)
        apart = float(np.abs(camera.project(true.apply(pad.outline_m)) - place).max())
    seen.set_aspect("equal")
    seen.set_title(f"seen from {MIRROR_M:g} m: {apart:.2f} px apart at most", fontsize=10)
    seen.set_xlabel("pixels", fontsize=9)
    seen.tick_params(labelsize=8)
    seen.grid(alpha=0.3)
    seen.legend(fontsize=8, loc="center")
    return _drawn(figure)


def _draw_side(axes: Axes) -> None:
    """Draw camera, line of sight, and both pads with their normals."""
    eye, tilt = (0.0, 3.0), math.radians(24.0)
    axes.plot([0.0, eye[0]], [0.0, eye[1]], color="#888888", linestyle="--", linewidth=1.0)
    axes.plot(*eye, marker="v", markersize=12, color="#222222")
    axes.text(0.18, 2.95, "camera", fontsize=9)
    axes.text(0.06, 1.9, "line of sight", fontsize=9, color="#666666")
    for sign, color, name in ((1.0, "#0072b2", "the pad"), (-1.0, "#d55e00", "its mirror image")):
        along = np.array([math.cos(tilt), sign * math.sin(tilt)])
        normal = np.array([-along[1], along[0]])
        axes.plot(*zip(-along, along, strict=True), color=color, linewidth=4.0, solid_capstyle="butt")
        x, y = (1.2 * normal).tolist()
        axes.annotate("", (x, y), (0.0, 0.0), arrowprops={"arrowstyle": "->", "color": color, "lw": 1.8})
        axes.text(x - (0.55 if sign > 0 else 0.0), y + 0.1, "normal", fontsize=9, color=color)
        axes.text(1.05, along[1] * 1.0 - 0.05, name, fontsize=9, color=color)
    axes.set_xlim(-1.6, 2.4)
    axes.set_ylim(-0.6, 3.2)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title("from the side", fontsize=10)


def error_chart(landing: Landing) -> PilImage.Image:
    """Return the errors of every frame's pose over the distance: of the place and of the normal."""
    figure = Figure(figsize=(9.6, 3.6), dpi=100)
    FigureCanvasAgg(figure)
    errors = [
        (row["method"], *_errors(_pose(row), truth))
        for row, truth in zip(landing.poses, landing.truth, strict=True)
        if row is not None
    ]
    places = {"left": 0.06, "right": 0.99, "top": 0.9, "bottom": 0.15, "wspace": 0.2}
    titles = ("along the line of sight, % of the distance", "across it, % of the distance", "normal, degrees")
    for number, (axes, title) in enumerate(zip(figure.subplots(1, 3, gridspec_kw=places), titles, strict=True)):
        for method in ("target", "tag", "box"):
            points = np.array([error[1:] for error in errors if error[0] == method])
            if len(points):
                axes.plot(
                    points[:, 0], points[:, 1 + number], ".", color=METHOD_COLORS[method], markersize=3, label=method
                )
        axes.set_xlim(0.0, 21.0)
        axes.set_ylim(0.0, 1.1 * float(np.percentile([error[2 + number] for error in errors], 99.5)))
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("distance, m", fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8, loc="upper left", markerscale=3)
    return _drawn(figure)


def _errors(pose: Pose, truth: Pose) -> tuple[float, float, float, float]:
    """Return distance, errors along and across the line of sight in percent of it, and of the normal in degrees."""
    distance = float(np.linalg.norm(truth.translation))
    off, ray = pose.translation - truth.translation, truth.translation / distance
    along = float(off @ ray)
    across = float(np.linalg.norm(off - along * ray))
    cosine = float(np.clip(pose.rotation[:, 2] @ truth.rotation[:, 2], -1.0, 1.0))
    return distance, 100.0 * abs(along) / distance, 100.0 * across / distance, math.degrees(math.acos(cosine))


def _drawn(figure: Figure) -> PilImage.Image:
    data = BytesIO()
    figure.savefig(data, format="png")
    return PilImage.open(data).convert("RGB")


if __name__ == "__main__":
    main()
