"""Plain grounds to lay under the pad, in linear light, and the whole scene of pad, ground and sky."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import cv2
import numpy as np

from landtool.camera import Camera
from landtool.errors import UsageError
from landtool.geometry import Pose
from landtool.pad import PadSpec
from landtool.synth.looks import LOOKS, GroundKind
from landtool.synth.render import Linear, render_pad, sample_plane
from landtool.synth.texture import PadTexture, PlaneTexture, pyramid

_TEXELS = 2048
_TILE_M = 8.192
# The second, coarse picture breaks up the pattern of the first one's repeats; its tile is no multiple of the first's.
_COARSE_TEXELS = 256
_COARSE_TILE_M = 89.0
_SAMPLES = 3
# linear light of a hazy sky, blue first
_SKY = (0.80, 0.68, 0.58)


@dataclass(frozen=True, eq=False)
class Ground:
    """A ground without end: the plane z = 0 of its own frame.

    detail: what repeats every few metres. patches: slow change of brightness over it, 0.5 where there is none.
    """

    detail: PlaneTexture
    patches: PlaneTexture


def make_ground(kind: GroundKind, rng: np.random.Generator) -> Ground:
    """Return a ground of a kind, other stones and blades for other states of `rng`.

    Raises UsageError for an unknown kind.
    """
    if kind not in LOOKS:
        raise UsageError(f"unknown ground '{kind}'", hint=f"known: {', '.join(get_args(GroundKind))}")
    look = LOOKS[kind]
    mix = value_noise(_TEXELS, look.first_cells, look.persistence, rng)[:, :, None]
    dark, bright = (np.array(color, np.float32) for color in (look.dark, look.bright))
    picture = dark + (bright - dark) * np.clip(0.5 + look.contrast * mix, 0.0, 1.0)
    if look.slab_m:
        _joints(picture, round(_TILE_M / look.slab_m))
    patches = 0.5 + look.patchiness * value_noise(_COARSE_TEXELS, 4, 0.6, rng)[:, :, None]
    coarse = np.repeat(np.clip(patches, 0.0, 1.0), 3, axis=2)
    return Ground(
        PlaneTexture(pyramid(picture), _TILE_M / _TEXELS, repeats=True),
        PlaneTexture(pyramid(coarse), _COARSE_TILE_M / _COARSE_TEXELS, repeats=True),
    )


def value_noise(size: int, first_cells: int, persistence: float, rng: np.random.Generator) -> Linear:
    """Return smooth noise (size, size) of mean 0 and standard deviation 1 that tiles the plane.

    Octaves of 1, 2, 4 ... times `first_cells` random values a side are added, each `persistence` times as strong as
    the one before; size and first_cells are powers of two.
    """
    total = np.zeros((size, size), np.float32)
    strength, cells = 1.0, first_cells
    while cells <= size:
        total += np.float32(strength) * _enlarged(rng.standard_normal((cells, cells), np.float32), size)
        strength, cells = strength * persistence, cells * 2
    noise: Linear = (total - total.mean()) / total.std()
    return noise


def render_scene(
    camera: Camera,
    camera_T_pad: Pose,
    pad: PadSpec | PadTexture,
    ground: Ground,
    *,
    camera_T_ground: Pose,
    supersample: int | None = None,
    light: float = 1.0,
) -> Linear:
    """Return the pad over the ground, (H, W, 3) float32 linear light, sky where the ground ends.

    camera_T_ground: where the ground's plane lies; `ground_below` makes one from the pad's pose. supersample: of the
    pad, as in `render_pad`. light: factor on the whole scene.
    """
    background = render_ground(camera, camera_T_ground, ground)
    background *= np.float32(light)
    return render_pad(camera, camera_T_pad, pad, background=background, supersample=supersample, light=light)


def render_ground(camera: Camera, camera_T_ground: Pose, ground: Ground) -> Linear:
    """Return the ground alone, (H, W, 3) float32 linear light, sky where it ends."""
    box = (0, 0, camera.width, camera.height)
    image = sample_plane(camera, camera_T_ground, ground.detail, box, _SAMPLES)
    patches = sample_plane(camera, camera_T_ground, ground.patches, box, 1)
    sky = ~patches.any(axis=2)
    image *= 2.0 * patches
    image[sky] = _SKY
    return image


def ground_below(camera_T_pad: Pose, height_m: float) -> Pose:
    """Return `camera_T_ground` of a ground `height_m` under the pad and parallel to it, moving with it."""
    return camera_T_pad @ Pose(np.eye(3), np.array([0.0, 0.0, -height_m]))


def _enlarged(cells: Linear, size: int) -> Linear:
    """Return periodic values (n, n) smoothly enlarged to (size, size)."""
    n, rim = len(cells), 2
    wrapped = cv2.copyMakeBorder(cells, rim, rim, rim, rim, cv2.BORDER_WRAP)
    scale = size // n
    large = cv2.resize(wrapped, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    return np.asarray(large[rim * scale : -rim * scale, rim * scale : -rim * scale], dtype=np.float32)


def _joints(picture: Linear, slabs: int) -> None:
    """Darken the joints between slabs, `slabs` a side of the picture, three texels wide."""
    step = len(picture) // slabs
    for first in range(0, len(picture), step):
        picture[first : first + 3] *= 0.45
        picture[:, first : first + 3] *= 0.45
