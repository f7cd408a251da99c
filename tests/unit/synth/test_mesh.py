from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest

from landtool.synth.mesh import Mesh, ball, bar, box, circle, cylinder, flat, loft, panels, rounded, wedge

GREY = (0.2, 0.2, 0.2)
TRAPEZE = [(-1.0, 0.0), (1.0, 0.0), (0.5, 1.0), (-0.5, 1.0)]

# with its volume, by hand
BODIES: dict[str, tuple[Callable[[], Mesh], float]] = {
    "box": (lambda: box((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), GREY), 6.0),
    "cylinder": (lambda: cylinder(1.0, 1.0, 3.0, GREY, sides=4), 4.0),
    "loft": (lambda: loft(flat(circle(1.0, 4), 0.0), flat(circle(2.0, 4), 3.0, x_m=1.0), GREY), 14.0),
    "wedge": (lambda: wedge(TRAPEZE, 1.0, 1.0, GREY), 3.0),
    "bar": (lambda: bar((1.0, 2.0, 3.0), (1.0, 5.0, 7.0), 0.2, GREY), 0.2),
    "upright bar": (lambda: bar((0.0, 0.0, 0.0), (0.0, 0.0, 3.0), 0.5, GREY), 0.75),
}


def _volume(mesh: Mesh) -> float:
    """By the divergence theorem: positive only when the faces look outward."""
    total = 0.0
    for face in mesh.faces:
        a, *rest = mesh.points_m[face]
        total += sum(float(a @ np.cross(b, c)) for b, c in itertools.pairwise(rest)) / 6.0
    return total


@pytest.mark.parametrize("kind", BODIES)
def test_bodies_hold_their_volume_with_faces_that_look_outward(kind: str) -> None:
    make, volume = BODIES[kind]
    assert _volume(make()) == pytest.approx(volume)


def test_a_ball_of_many_faces_comes_near_a_sphere() -> None:
    assert _volume(ball(2.0, GREY, sides=40, rings=40)) == pytest.approx(4.0 / 3.0 * np.pi * 8.0, rel=0.02)


def test_a_wedge_leans_its_sides_inward_with_height() -> None:
    mesh = wedge(TRAPEZE, 2.0, 1.0, GREY)
    np.testing.assert_allclose(np.abs(mesh.points_m[mesh.points_m[:, 2] == 0.0, 1]), 2.0)
    np.testing.assert_allclose(np.abs(mesh.points_m[mesh.points_m[:, 2] == 1.0, 1]), 1.0)


def test_a_round_outline_has_no_two_points_together_even_when_it_is_all_arc() -> None:
    outline = rounded(1.0, 1.0, 5.0)
    assert np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1).min() > 1e-3


def test_the_top_of_a_loft_has_its_own_albedo() -> None:
    mesh = loft(flat(circle(1.0, 5), 0.0), flat(circle(1.0, 5), 1.0), GREY, top_albedo=(0.5, 0.6, 0.7))
    np.testing.assert_array_equal(mesh.albedo[-1], (0.5, 0.6, 0.7))
    np.testing.assert_array_equal(mesh.albedo[:-1], np.tile(GREY, (6, 1)))


def test_panels_are_seen_from_outside_only_and_throw_no_shadow() -> None:
    mesh = panels([flat(circle(1.0, 4), 1.0), flat(circle(1.0, 6), 2.0)], [GREY, GREY])
    assert mesh.closed
    assert not mesh.casts
    assert [len(face) for face in mesh.faces] == [4, 6]
