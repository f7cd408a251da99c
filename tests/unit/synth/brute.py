"""A second way to render a pad, slow and plain: the shapes themselves, asked at many places in every pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landtool.camera import Camera
from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.io.poses import STRAIGHT_DOWN
from landtool.pad import PadSpec, Shape
from landtool.tone import srgb_decode

PINHOLE = Camera(640, 480, 554.0, 554.0, 319.5, 239.5)
BARREL = Camera(640, 480, 400.0, 401.0, 322.0, 236.0, "plumb_bob", (-0.25, 0.06, 0.001, -0.0005, 0.0))
FISHEYE = Camera(640, 480, 250.0, 250.0, 320.0, 240.0, "equidistant", (0.02, -0.01, 0.003, 0.0))


def looking_down(
    z_m: float, x_m: float = 0.0, y_m: float = 0.0, rotvec: tuple[float, float, float] = (0, 0, 0)
) -> Pose:
    """Return camera_T_pad of a camera above the pad, image top along pad x, the pad then turned by `rotvec`."""
    return Pose(rotation_from_rotvec(rotvec) @ STRAIGHT_DOWN.rotation.T, np.array([x_m, y_m, z_m]))


def inside(shape: Shape, points: Array) -> NDArray[np.bool_]:
    """Say which points (N, 2) of the pad plane a shape holds."""
    if shape.radius_m:
        return np.asarray(np.hypot(*(points - shape.points_m[0]).T) <= shape.radius_m)
    odd = np.zeros(len(points), np.bool_)
    for a, b in zip(shape.points_m, np.roll(shape.points_m, -1, axis=0), strict=True):
        if a[1] != b[1]:
            spans = (a[1] > points[:, 1]) != (b[1] > points[:, 1])
            odd ^= spans & (points[:, 0] < (b[0] - a[0]) * (points[:, 1] - a[1]) / (b[1] - a[1]) + a[0])
    return odd


def pad_light(pad: PadSpec, points: Array) -> Array:
    """Return the light (N, 3), blue first, of points (N, 2) on the pad plane; black beside the pad."""
    light = np.zeros((len(points), 3))
    for shape in pad.shapes():
        light[inside(shape, points)] = srgb_decode(np.array(shape.color[::-1]) / 255.0)
    return light


def brute_force(camera: Camera, camera_T_pad: Pose, pad: PadSpec, box: tuple[int, int, int, int], k: int = 32) -> Array:
    """Return the mean light of k x k places in every pixel of a box (x0, y0, x1, y1)."""
    x0, y0, x1, y1 = box
    pad_T_camera = camera_T_pad.inverse()
    rows = []
    for y_px in range(y0, y1):
        x, y = np.meshgrid(x0 - 0.5 + (np.arange((x1 - x0) * k) + 0.5) / k, y_px - 0.5 + (np.arange(k) + 0.5) / k)
        direction = camera.unproject(np.column_stack([x.ravel(), y.ravel()])) @ pad_T_camera.rotation.T
        s = -pad_T_camera.translation[2] / direction[:, 2]
        points = (pad_T_camera.translation + s[:, None] * direction)[:, :2]
        rows.append(pad_light(pad, points).reshape(k, x1 - x0, k, 3).mean(axis=(0, 2)))
    return np.stack(rows)
