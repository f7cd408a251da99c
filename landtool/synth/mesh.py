"""Bodies of flat faces, in metres: what vehicles, people and boxes are made of."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landtool.geometry import Array, Pose

# linear light a surface gives back, blue first, each in [0, 1]
Albedo = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Mesh:
    """One convex body, or a few loose flat faces.

    points_m: (P, 3) in the frame the mesh stands in, z up. faces: (K,) indices of points, counter-clockwise as seen
    from outside. albedo: (F, 3) a face, linear light, blue first. closed: whether it is a convex body, whose faces are
    seen from outside only; loose faces are seen from both sides. casts: whether it throws a shadow.
    """

    points_m: Array
    faces: tuple[NDArray[np.intp], ...]
    albedo: Array
    closed: bool = True
    casts: bool = True

    def moved(self, a_T_b: Pose) -> Mesh:
        """Return the mesh of frame b in frame a."""
        return self._with(a_T_b.apply(self.points_m))

    def stretched(self, factors: ArrayLike) -> Mesh:
        """Return the mesh with its coordinates multiplied by positive factors, (3,) or one for all."""
        return self._with(self.points_m * np.asarray(factors, dtype=np.float64))

    def _with(self, points_m: Array) -> Mesh:
        # as dataclasses.replace, in a fifth of its time
        return Mesh(points_m, self.faces, self.albedo, self.closed, self.casts)


# Meshes in the order they are painted: what lies below or behind first
Thing = tuple[Mesh, ...]


def place(thing: Thing, a_T_b: Pose) -> Thing:
    """Return a thing of frame b in frame a."""
    if not thing:
        return thing
    points = a_T_b.apply(np.concatenate([mesh.points_m for mesh in thing]))
    ends = list(itertools.accumulate(len(mesh.points_m) for mesh in thing))
    return tuple(mesh._with(points[a:b]) for mesh, a, b in zip(thing, [0, *ends], ends, strict=False))


def box(size_m: ArrayLike, centre_m: ArrayLike, albedo: Albedo, *, taper: float = 0.0) -> Mesh:
    """Return a box of size (3,) about `centre_m` (3,); taper: share by which its top is narrower than its foot."""
    half = np.asarray(size_m, dtype=np.float64) / 2.0
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=np.float64)
    foot = np.column_stack([signs * half[:2], np.full(4, -half[2])])
    top = np.column_stack([signs * half[:2] * (1.0 - taper), np.full(4, half[2])])
    return _between(foot, top, albedo, np.asarray(centre_m, dtype=np.float64))


def prism(outline_m: ArrayLike, z_from_m: float, z_to_m: float, albedo: Albedo, *, taper: float = 0.0) -> Mesh:
    """Return an upright prism over a convex outline (N, 2), counter-clockwise seen from above; taper as in `box`."""
    outline = np.asarray(outline_m, dtype=np.float64)
    middle = outline.mean(axis=0)
    foot = np.column_stack([outline, np.full(len(outline), z_from_m)])
    top = np.column_stack([middle + (outline - middle) * (1.0 - taper), np.full(len(outline), z_to_m)])
    return _between(foot, top, albedo, np.zeros(3))


def cylinder(
    radius_m: float, z_from_m: float, z_to_m: float, albedo: Albedo, *, sides: int = 14, taper: float = 0.0
) -> Mesh:
    """Return an upright cylinder about z, or with taper = 1 a cone."""
    return prism(circle(radius_m, sides), z_from_m, z_to_m, albedo, taper=min(taper, 0.999))


def ball(radius_m: float, albedo: Albedo, *, sides: int = 10, rings: int = 5) -> Mesh:
    """Return a sphere about the origin; `Mesh.stretched` makes an ellipsoid of it."""
    polar = np.pi * (np.arange(1, rings) / rings)
    rim = circle(1.0, sides)
    bands = [np.column_stack([rim * np.sin(p), np.full(sides, np.cos(p))]) for p in polar]
    points = radius_m * np.concatenate([np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]), *bands])
    faces: list[NDArray[np.intp]] = []
    for i in range(sides):
        j, last = (i + 1) % sides, 2 + (rings - 2) * sides
        faces.append(np.array([0, 2 + i, 2 + j]))
        faces.append(np.array([1, last + j, last + i]))
        for band in range(rings - 2):
            a, b = 2 + band * sides, 2 + (band + 1) * sides
            faces.append(np.array([a + i, b + i, b + j, a + j]))
    return Mesh(points, tuple(faces), np.tile(np.array(albedo), (len(faces), 1)))


def patch(points_m: ArrayLike, albedo: Albedo, *, casts: bool = False) -> Mesh:
    """Return one flat face (N, 3), counter-clockwise seen from its front, seen from both sides."""
    points = np.asarray(points_m, dtype=np.float64)
    return Mesh(points, (np.arange(len(points)),), np.array([albedo], dtype=np.float64), closed=False, casts=casts)


def loose(polygons_m: Sequence[ArrayLike], albedos: Sequence[Albedo], *, casts: bool = False) -> Mesh:
    """Return several flat faces (N, 3), each with its albedo, seen from both sides."""
    parts = [np.asarray(polygon, dtype=np.float64) for polygon in polygons_m]
    starts = np.cumsum([0, *map(len, parts)])
    faces = tuple(np.arange(a, b) for a, b in itertools.pairwise(starts))
    return Mesh(np.concatenate(parts), faces, np.array(albedos, dtype=np.float64), closed=False, casts=casts)


def circle(radius_m: float, sides: int) -> Array:
    """Return points (sides, 2) on a circle about the origin, counter-clockwise."""
    angle = np.arange(sides) * (2.0 * np.pi / sides)
    return radius_m * np.column_stack([np.cos(angle), np.sin(angle)])


def rounded(length_m: float, width_m: float, radius_m: float, *, steps: int = 3) -> Array:
    """Return the outline (4 (steps + 1), 2) of a rectangle with round corners, counter-clockwise, length along x."""
    # just less than half a side, so that no two points fall together
    radius = min(radius_m, 0.49 * length_m, 0.49 * width_m)
    inner = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (length_m / 2.0 - radius, width_m / 2.0 - radius)
    quarter = np.linspace(0.0, np.pi / 2.0, steps + 1)
    arcs = [
        c + radius * np.column_stack([np.cos(quarter + t), np.sin(quarter + t)])
        for c, t in zip(inner, np.arange(4) * np.pi / 2.0, strict=True)
    ]
    return np.concatenate(arcs)


def loft(foot_m: ArrayLike, top_m: ArrayLike, albedo: Albedo, *, top_albedo: Albedo | None = None) -> Mesh:
    """Return the convex body between two flat outlines (N, 3) whose edges are parallel one by one.

    Both are counter-clockwise seen from the side of the top. `rounded` outlines of any two sizes have such edges.
    Faces: the foot, one an edge, the top.
    """
    mesh = _between(np.asarray(foot_m, dtype=np.float64), np.asarray(top_m, dtype=np.float64), albedo, np.zeros(3))
    if top_albedo is not None:
        mesh.albedo[-1] = top_albedo
    return mesh


def flat(outline_m: Array, z_m: float, *, x_m: float = 0.0, y_m: float = 0.0) -> Array:
    """Return the outline (N, 2) as points (N, 3) at a height, moved by x and y."""
    points = np.zeros((len(outline_m), 3))
    points[:, :2] = outline_m
    points += (x_m, y_m, z_m)
    points[:, 2] = z_m
    return points


def wedge(profile_m: ArrayLike, foot_half_m: float, top_half_m: float, albedo: Albedo) -> Mesh:
    """Return a body with a convex side view (N, 2) in x and z, counter-clockwise with x to the right and z up.

    Its sides are flat, at y = +-foot_half_m where it is lowest and +-top_half_m where it is highest. Faces: the left
    side (+y), one an edge of the profile, the right side; points 0 to N - 1 are the left ones, N to 2 N - 1 the right.
    """
    profile = np.asarray(profile_m, dtype=np.float64)
    x, z = profile[:, 0], profile[:, 1]
    half = foot_half_m + (top_half_m - foot_half_m) * (z - z.min()) / (z.max() - z.min())
    return _between(np.stack([x, half, z], axis=1), np.stack([x, -half, z], axis=1), albedo, np.zeros(3))


def bar(
    from_m: ArrayLike, to_m: ArrayLike, width_m: float, albedo: Albedo, *, end_m: float | None = None, sides: int = 4
) -> Mesh:
    """Return a straight bar `width_m` thick, `end_m` at its far end, from one point (3,) to another."""
    start, end = np.asarray(from_m, dtype=np.float64), np.asarray(to_m, dtype=np.float64)
    along = (end - start) / np.linalg.norm(end - start)
    # u x v = along; a bar that lies has one side up
    u = np.array([-along[1], along[0], 0.0]) if abs(along[2]) < 0.99 else np.array([0.0, -along[2], along[1]])
    u /= np.linalg.norm(u)
    v = np.array(
        [along[1] * u[2] - along[2] * u[1], along[2] * u[0] - along[0] * u[2], along[0] * u[1] - along[1] * u[0]]
    )
    angle = (np.arange(sides) + 0.5) * (2.0 * np.pi / sides)
    ring = (np.outer(np.cos(angle), u) + np.outer(np.sin(angle), v)) * (0.5 / np.cos(np.pi / sides))
    return _between(start + ring * width_m, end + ring * (width_m if end_m is None else end_m), albedo, np.zeros(3))


def panels(polygons_m: Sequence[ArrayLike], albedos: Sequence[Albedo]) -> Mesh:
    """Return flat faces (N, 3) on the skin of a body: seen from outside only, no shadow of their own."""
    return replace(loose(polygons_m, albedos), closed=True)


def _between(foot: Array, top: Array, albedo: Albedo, centre_m: Array) -> Mesh:
    """Return the convex body between two outlines (N, 3) of as many points."""
    faces = _between_faces(len(foot))
    colours = np.empty((len(faces), 3))
    colours[:] = albedo
    return Mesh(np.concatenate([foot, top]) + centre_m, faces, colours)


@lru_cache(maxsize=64)
def _between_faces(n: int) -> tuple[NDArray[np.intp], ...]:
    sides = [np.array([i, (i + 1) % n, n + (i + 1) % n, n + i]) for i in range(n)]
    faces = (np.arange(n)[::-1].copy(), *sides, np.arange(n, 2 * n))
    for face in faces:
        face.setflags(write=False)  # shared by all bodies of this many corners
    return faces
