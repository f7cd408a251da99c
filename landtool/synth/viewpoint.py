"""Where a picture is taken from: a camera, and its place over a pad that is to be seen at a pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from landtool.camera import Camera
from landtool.errors import UsageError
from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN
from landtool.pad import PadSpec
from landtool.synth.domain import Domain, chance, log_uniform, uniform
from landtool.synth.truth import rim_m, visible_of_rim

# sights flatter than this against the ground show nothing of a pad
_FLATTEST_RAD = math.radians(75.0)
_TRIES, _ROUNDS = 40, 200
# centres of cut pads lie up to this share of the picture beyond its border
_BEYOND = 0.35
# a pad of fewer pixels is not to be found
_SMALLEST_PX = 6.0
# of the rim's points every 12th is enough to say how much of a pad is in the picture
_RIM_STEP = 12


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A camera and where it is. pad_T_camera: pose over the pad (or over the place a pad would have).

    yaw_rad: turn of the pad on its plane against the camera's horizontal axis.
    """

    camera: Camera
    pad_T_camera: Pose
    height_m: float
    tilt_rad: float
    yaw_rad: float


def random_camera(domain: Domain, width: int, height: int, rng: np.random.Generator) -> Camera:
    """Return a camera with a lens that is one-to-one well beyond the picture's corners."""
    base = Camera.from_hfov(width, height, uniform(rng, domain.hfov_deg))
    aspect = float(rng.normal(1.0, 0.002))
    cx, cy = base.cx + rng.normal(0.0, 0.01) * width, base.cy + rng.normal(0.0, 0.01) * height
    k1 = uniform(rng, domain.distortion_k1) if chance(rng, domain.distortion) else 0.0
    # lenses that bend much bend less again farther out
    k2, p1, p2 = float(rng.uniform(0.15, 0.5)) * k1 * k1 * 3.0, *(float(v) for v in rng.normal(0.0, 0.0005, 2))
    coefficients = (k1, k2, p1, p2, 0.0) if k1 else (0.0,) * 5
    camera = replace(base, fy=base.fy * aspect, cx=float(cx), cy=float(cy), assumed="", distortion=coefficients)
    while not _well_behaved(camera):
        camera = replace(camera, distortion=tuple(0.6 * d for d in camera.distortion))
    return camera


def random_viewpoint(domain: Domain, pad: PadSpec, camera: Camera, rng: np.random.Generator) -> Viewpoint:
    """Return a place over the pad from which enough of it is in the picture.

    Raises UsageError when the domain has none, as far as chance can tell.
    """
    for _ in range(_ROUNDS):
        tilt, yaw = math.radians(uniform(rng, domain.tilt_deg)), float(rng.uniform(-math.pi, math.pi))
        # a tilted camera looks farther: it is lower by as much, or tilted pictures would have the smaller pads
        height = max(log_uniform(rng, domain.height_m) * math.cos(tilt), domain.height_m[0]) * pad.diameter_m
        azimuth = float(rng.uniform(-math.pi, math.pi))
        cut = chance(rng, domain.cut)
        rotation = _rotation(tilt, azimuth, yaw)
        for _ in range(_TRIES):
            pad_T_camera = _over(camera, rotation, height, _place(camera, cut, rng))
            if pad_T_camera is not None and _seen_well(domain, pad, camera, pad_T_camera, cut):
                return Viewpoint(camera, pad_T_camera, height, tilt, yaw)
    low, high = domain.height_m
    raise UsageError(
        f"from heights of {low:g} to {high:g} m hardly any picture shows {100 * domain.least_visible:g} % of the pad",
        hint="change height_m, tilt_deg, hfov_deg or least_visible, or give larger pictures",
    )


def size_px(camera: Camera, camera_T_pad: Pose, pad: PadSpec) -> float:
    """Return the pixels a ring that faced the camera would measure across, at the pad's distance."""
    diameter = (pad.ring.outer if pad.ring else pad.extent_m / pad.diameter_m) * pad.diameter_m
    return camera.fx * diameter / float(np.linalg.norm(camera_T_pad.translation))


def _rotation(tilt_rad: float, azimuth_rad: float, yaw_rad: float) -> Array:
    """Return the camera's rotation over a level pad: straight down, turned, then tilted."""
    lean = rotation_from_rotvec(tilt_rad * np.array([math.cos(azimuth_rad), math.sin(azimuth_rad), 0.0]))
    rotation: Array = lean @ rotation_from_rotvec([0.0, 0.0, yaw_rad]) @ STRAIGHT_DOWN.rotation
    return rotation


def _place(camera: Camera, cut: bool, rng: np.random.Generator) -> Array:
    """Return the pixel (2,) of the pad's centre: anywhere in the picture, for a cut pad beyond it, too."""
    margin = _BEYOND if cut else 0.0
    at = rng.uniform(-margin, 1.0 + margin, 2)
    pixel: Array = at * (camera.width, camera.height) - 0.5
    return pixel


def _over(camera: Camera, rotation: Array, height_m: float, pixel: Array) -> Pose | None:
    """Return the camera's pose from which the pad's centre is seen at a pixel; None when its sight is too flat."""
    ray = camera.normalize(pixel[None])[0]
    if not np.isfinite(ray).all() or not np.allclose(camera.project(np.array([[*ray, 1.0]]))[0], pixel, atol=0.5):
        return None
    sight = rotation @ np.array([*ray, 1.0])
    if -sight[2] < math.cos(_FLATTEST_RAD) * np.linalg.norm(sight):
        return None
    return Pose(rotation, -sight * (height_m / -sight[2]))


def _seen_well(domain: Domain, pad: PadSpec, camera: Camera, pad_T_camera: Pose, cut: bool) -> bool:
    camera_T_pad = pad_T_camera.inverse()
    if size_px(camera, camera_T_pad, pad) < _SMALLEST_PX:
        return False
    if pad.ring is None:
        return bool(np.isfinite(camera.project(camera_T_pad.apply(np.zeros((1, 3))))).all())
    rim = camera.project(camera_T_pad.apply(rim_m(pad)[::_RIM_STEP]))
    if camera_T_pad.inverse().translation[2] <= 0.0 or not np.isfinite(rim).all():
        return False
    share = visible_of_rim(camera, rim)
    if share < domain.least_visible:
        return False
    # a pad meant to be cut is cut, unless it is larger than the picture anyway
    return not cut or share < 0.98


def _well_behaved(camera: Camera) -> bool:
    """Whether pixels well beyond the picture's border still have a ray of their own."""
    w, h = camera.width, camera.height
    rim = np.array([[x * w, y * h] for x in (-0.25, 0.5, 1.25) for y in (-0.25, 0.5, 1.25)]) - 0.5
    rays = camera.normalize(rim)
    back = camera.project(np.column_stack([rays, np.ones(len(rays))]))
    return bool(np.isfinite(back).all() and np.allclose(back, rim, atol=0.05))
