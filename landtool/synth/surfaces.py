"""All flat faces of a scene in the order they are painted, and the light each gives back."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.synth.faces import Faces
from landtool.synth.mesh import Mesh, place
from landtool.synth.print_layer import outline_m
from landtool.synth.scene import Decal, Scene, Sun, is_under
from landtool.synth.view import View

# ids of surfaces: 0 is the ground, then the print, then the decals, then faces of bodies
PRINT, FIRST_DECAL = 1, 2
_STILL = (0.0, 0.0, 0.0)
# a decal lower than this lies on the ground
ON_GROUND_M = 0.03
# light a face gets that looks sideways or down, as a share of the open sky's
_SIDE, _UNDER = 0.62, 0.25


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The faces of a scene.

    faces: in paint order. By id, (n, ...) float32: what a surface gives back of the sky's and of the sun's
    light (n, 3); its plane, n . (p - eye) = d, as (nx, ny, nz, d) in the world (n, 4). tops: (n,) bool, whether it is
    an upper side of the pad's carrier, which the shadows on the pad cross. platform: (n,) bool, whether it moves with
    the pad. decals: by id.
    """

    faces: Faces
    sky: NDArray[np.float32]
    sun: NDArray[np.float32]
    planes: NDArray[np.float32]
    tops: NDArray[np.bool_]
    platform: NDArray[np.bool_]
    decals: dict[int, Decal]


def surfaces_of(scene: Scene, view: View) -> Surfaces:
    """Return the surfaces of everything that may be seen."""
    eye = view.world_T_camera.translation
    build = _Build(scene.sun, eye, FIRST_DECAL + len(scene.decals))
    low = {i: d for i, d in enumerate(scene.decals) if d.world_T_plane.translation[2] < ON_GROUND_M}
    for i, decal in low.items():
        build.decal(FIRST_DECAL + i, decal)
    for _, paint in sorted(_groups(scene, eye, set(low), build), key=lambda item: -item[0]):
        paint()
    return build.surfaces({FIRST_DECAL + i: d for i, d in enumerate(scene.decals)})


def _groups(scene: Scene, eye: Array, low: set[int], build: _Build) -> Iterator[tuple[float, Callable[[], None]]]:
    """Yield how far from below the camera each thing stands, and what paints it.

    Upright bodies lean away from the point below the camera, so what stands nearer to it hides what stands farther.
    """
    for thing in scene.things:
        centre = np.mean([mesh.points_m[:, :2].mean(axis=0) for mesh in thing], axis=0)
        yield float(np.hypot(*(centre - eye[:2]))), partial(build.meshes, thing)
    for i, decal in enumerate(scene.decals):
        if i not in low:
            # a sign on something is painted just after it
            away = float(np.hypot(*(decal.world_T_plane.translation[:2] - eye[:2])))
            yield away - 0.05, partial(build.decal, FIRST_DECAL + i, decal)
    if scene.target is not None:
        away = float(np.hypot(*(scene.target.world_T_pad.translation[:2] - eye[:2])))
        yield away, partial(build.target, scene)


class _Build:
    """Collects polygons and what their surfaces look like."""

    def __init__(self, sun: Sun, eye: Array, first: int) -> None:
        self._light, self._eye = sun, eye
        self._faces: list[Faces] = []
        self._normals: list[Array] = [np.tile([0.0, 0.0, 1.0], (first, 1))]
        self._offsets: list[Array] = [np.full(first, -eye[2])]
        self._albedo: list[Array] = [np.zeros((first, 3))]
        self._platform: list[NDArray[np.bool_]] = [np.zeros(first, np.bool_)]
        self._next = first

    def target(self, scene: Scene) -> None:
        """Add the pad, what it lies on and what lies on it."""
        target = scene.target
        assert target is not None
        below = tuple(m for m in target.carrier if is_under(m))
        beside = tuple(m for m in target.carrier if not is_under(m))
        self.meshes(place(below, target.world_T_pad), target.velocity_mps, platform=True)
        rim = outline_m(target, target.pad.extent_m / 2.0)
        up = target.world_T_pad.rotation[:, 2]
        if up @ (self._eye - target.world_T_pad.translation) > 0.0:
            self._faces.append(replace(Faces.of([rim], PRINT), velocity_mps=np.array([target.velocity_mps])))
        self._normals[0][PRINT], self._platform[0][PRINT] = up, True
        self._offsets[0][PRINT] = up @ (target.world_T_pad.translation - self._eye)
        self.meshes(place((*beside, *target.above), target.world_T_pad), target.velocity_mps, platform=True)

    def decal(self, id: int, decal: Decal) -> None:
        """Add the square of a decal."""
        rim = decal.corners_m
        up = decal.world_T_plane.rotation[:, 2]
        self._normals[0][id], self._offsets[0][id] = up, up @ (rim[0] - self._eye)
        if up @ (self._eye - rim[0]) > 0.0:
            self._faces.append(Faces.of([rim], id))

    def meshes(
        self, thing: tuple[Mesh, ...], velocity: tuple[float, float, float] = _STILL, *, platform: bool = False
    ) -> None:
        """Add the faces of bodies that are turned to the camera."""
        if not thing:
            return
        points = np.concatenate([mesh.points_m for mesh in thing])
        shifts = np.cumsum([0, *(len(mesh.points_m) for mesh in thing[:-1])])
        per_mesh = [len(mesh.faces) for mesh in thing]
        corners = [face for mesh in thing for face in mesh.faces]
        counts = np.array([len(face) for face in corners], np.intp)
        flat = np.concatenate(corners) + np.repeat(np.repeat(shifts, per_mesh), counts)
        first = np.cumsum(counts) - counts
        a, b, c = (points[flat[first + i]] for i in range(3))
        normals = _cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        offsets = ((a - self._eye) * normals).sum(axis=1)
        seen = (offsets < 0.0) | np.repeat([not mesh.closed for mesh in thing], per_mesh)
        count = int(seen.sum())
        if not count:
            return
        # a loose face shows the side that is turned to the camera
        flip = np.where(offsets > 0.0, -1.0, 1.0)
        shown = points[flat[np.repeat(seen, counts)]]
        ids = self._next + np.arange(count)
        self._faces.append(Faces(shown, counts[seen], ids, np.tile(velocity, (count, 1))))
        self._normals.append((normals * flip[:, None])[seen])
        self._offsets.append((offsets * flip)[seen])
        self._albedo.append(np.concatenate([mesh.albedo for mesh in thing])[seen])
        self._platform.append(np.full(count, platform))
        self._next += count

    def surfaces(self, decals: dict[int, Decal]) -> Surfaces:
        """Return everything collected."""
        normals, albedo = np.concatenate(self._normals), np.concatenate(self._albedo)
        up = normals[:, 2]
        open_sky = np.where(up > 0, _SIDE + (1.0 - _SIDE) * up, _SIDE + (_SIDE - _UNDER) * up)
        facing = np.maximum(normals @ np.array(self._light.direction), 0.0)
        platform = np.concatenate(self._platform)
        return Surfaces(
            Faces.joined(self._faces),
            (albedo * open_sky[:, None] * np.array(self._light.sky)).astype(np.float32),
            (albedo * facing[:, None] * np.array(self._light.sun)).astype(np.float32),
            np.column_stack([normals, np.concatenate(self._offsets)]).astype(np.float32),
            platform & (up > 0.8),
            platform,
            decals,
        )


def _cross(a: Array, b: Array) -> Array:
    """Return the cross products of rows (N, 3)."""
    x, y, z = a.T
    u, v, w = b.T
    return np.column_stack([y * w - z * v, z * u - x * w, x * v - y * u])
