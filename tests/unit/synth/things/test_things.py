from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.random import Generator

from landtool.synth.mesh import Mesh, Thing
from landtool.synth.things import CARRIERS, PROPS, above_pad, drone, pole_shade, tree_shade

SEEDS = range(5)
MAKERS: dict[str, Callable[[Generator], Thing]] = {
    **{f"carrier-{kind}": (lambda rng, make=make: make(rng, 1.1).thing) for kind, make in CARRIERS.items()},
    **PROPS,
    "above": lambda rng: above_pad(rng, 1.1),
    "drone": drone,
    "pole_shade": pole_shade,
    "tree_shade": tree_shade,
}


def _normal(points: np.ndarray) -> np.ndarray:
    """Newell's normal of a polygon (N, 3): twice its area long."""
    return np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)


def _is_body(mesh: Mesh) -> bool:
    """Whether every edge of the mesh has a face on both sides; the panels on a body have not."""
    edges = {(int(a), int(b)) for face in mesh.faces for a, b in zip(face, np.roll(face, -1), strict=True)}
    return all((b, a) in edges for a, b in edges)


@pytest.mark.parametrize("kind", MAKERS)
def test_bodies_are_convex_and_their_faces_look_outward(kind: str) -> None:
    bodies = 0
    for seed in SEEDS:
        for mesh in MAKERS[kind](np.random.default_rng(seed)):
            size = float(np.ptp(mesh.points_m, axis=0).max())
            for face in mesh.faces:
                points = mesh.points_m[face]
                normal = _normal(points - points[0])
                assert np.linalg.norm(normal) > 1e-7, "a face without an area"
                normal /= np.linalg.norm(normal)
                assert np.abs((points - points[0]) @ normal).max() < 1e-6 * max(size, 1.0), "a face that is not flat"
                first = _normal(points[:3] - points[0])
                assert first @ normal > 0.9 * np.linalg.norm(first) > 0.0, "the first corner is none"
                if mesh.closed and _is_body(mesh):
                    # all the body is behind the plane of each of its faces
                    assert ((mesh.points_m - points[0]) @ normal).max() < 1e-6 * max(size, 1.0)
                    bodies += 1
    assert bodies or kind in ("tuft", "hose", "manhole")


@pytest.mark.parametrize("kind", MAKERS)
def test_things_are_finite_and_have_colours_a_surface_can_have(kind: str) -> None:
    for seed in SEEDS:
        thing = MAKERS[kind](np.random.default_rng(seed))
        assert thing
        for mesh in thing:
            assert np.isfinite(mesh.points_m).all()
            assert mesh.albedo.shape == (len(mesh.faces), 3)
            assert ((mesh.albedo > 0.0) & (mesh.albedo <= 0.95)).all()
            assert max(int(face.max()) for face in mesh.faces) < len(mesh.points_m)


@pytest.mark.parametrize("kind", MAKERS)
def test_the_same_generator_gives_the_same_thing_and_another_gives_another(kind: str) -> None:
    def built(seed: int) -> bytes:
        thing = MAKERS[kind](np.random.default_rng(seed))
        return b"".join(mesh.points_m.tobytes() + mesh.albedo.tobytes() for mesh in thing)

    assert built(3) == built(3)
    assert len({built(seed) for seed in SEEDS}) == len(SEEDS)


@pytest.mark.parametrize("kind", PROPS)
def test_props_stand_on_the_ground(kind: str) -> None:
    for seed in SEEDS:
        lowest = min(float(mesh.points_m[:, 2].min()) for mesh in PROPS[kind](np.random.default_rng(seed)))
        assert -1e-9 <= lowest < 0.05


@pytest.mark.parametrize("side_m", [0.2, 1.1])
@pytest.mark.parametrize("kind", CARRIERS)
def test_carriers_stand_on_the_ground_and_leave_the_pad_free(kind: str, side_m: float) -> None:
    grid = np.linspace(-0.499, 0.499, 9) * side_m
    spots = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    for seed in range(16):
        carrier = CARRIERS[kind](np.random.default_rng(seed), side_m)
        lowest = min(float(mesh.points_m[:, 2].min()) for mesh in carrier.thing)
        assert lowest == pytest.approx(-carrier.pad_height_m, abs=1e-9)
        for mesh in carrier.thing:
            if mesh.points_m[:, 2].max() > 1e-9:
                assert not _covers(mesh, spots).any(), f"seed {seed}"


@pytest.mark.parametrize("kind", CARRIERS)
def test_carriers_hold_most_of_the_pad_on_a_top_of_the_albedo_they_tell(kind: str) -> None:
    grid = np.linspace(-0.45, 0.45, 9) * 1.1
    spots = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    for seed in range(16):
        carrier = CARRIERS[kind](np.random.default_rng(seed), 1.1)
        under = np.zeros(len(spots), bool)
        for mesh in carrier.thing:
            if abs(float(mesh.points_m[:, 2].max())) < 1e-6:
                under |= _covers(mesh, spots)
        assert under.mean() > 0.8, f"seed {seed}"


@pytest.mark.parametrize("kind", CARRIERS)
def test_what_rises_above_the_pad_is_painted_last(kind: str) -> None:
    for seed in SEEDS:
        tops = [
            float(mesh.points_m[:, 2].max()) > 1e-9 for mesh in CARRIERS[kind](np.random.default_rng(seed), 1.1).thing
        ]
        assert tops == sorted(tops)


def test_what_lies_on_the_pad_is_above_it_and_mostly_over_it() -> None:
    grid = np.linspace(-0.55, 0.55, 56)
    spots = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    hides = 0
    for seed in range(100):
        thing = above_pad(np.random.default_rng(seed), 1.1)
        assert min(float(mesh.points_m[:, 2].min()) for mesh in thing) > 0.0
        share = np.any([_covers(mesh, spots) for mesh in thing], axis=0).mean()
        assert share < 0.5
        hides += share > 0.0
    assert hides > 80


def test_a_drone_is_about_half_a_metre_wide_and_casts_its_shadow() -> None:
    for seed in SEEDS:
        thing = drone(np.random.default_rng(seed))
        points = np.concatenate([mesh.points_m for mesh in thing if mesh.casts])
        assert 0.3 < np.ptp(points[:, :2], axis=0).max() < 1.3
        assert np.abs(points[:, 2]).max() < 0.2


@pytest.mark.parametrize(("kind", "most"), [("tree", 250), ("bush", 250), ("person", 70), ("cone", 75), ("lorry", 200)])
def test_things_stay_cheap_to_paint(kind: str, most: int) -> None:
    counts = [sum(len(mesh.faces) for mesh in PROPS[kind](np.random.default_rng(seed))) for seed in SEEDS]
    assert max(counts) <= most


def _covers(mesh: Mesh, spots_m: np.ndarray) -> np.ndarray:
    """Whether a mesh is above or below spots (N, 2), by its faces seen from above."""
    covered = np.zeros(len(spots_m), bool)
    for face in mesh.faces:
        rim = mesh.points_m[face][:, :2]
        turn = np.array([_cross(b - a, spots_m - a) for a, b in zip(rim, np.roll(rim, -1, axis=0), strict=True)])
        area = float(_cross(rim, np.roll(rim, -1, axis=0)).sum())
        if abs(area) > 1e-9:
            covered |= (turn * np.sign(area) >= 0.0).all(axis=0)
    return covered


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """z of the cross products of vectors (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
