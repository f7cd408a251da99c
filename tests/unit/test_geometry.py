"""The laws rigid transforms obey, whatever the numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from landtool.geometry import (
    Array,
    Pose,
    quaternion_from_rotation,
    rotation_angle,
    rotation_from_quaternion,
    rotation_from_rotvec,
    rotvec_from_rotation,
    skew,
)

quick = settings(max_examples=40, deadline=None)
vectors = arrays(np.float64, 3, elements=st.floats(-10, 10))
# components small enough that the vector stays shorter than pi, where a rotation has one rotation vector only
rotvecs = arrays(np.float64, 3, elements=st.floats(-1.8, 1.8))
poses = st.builds(Pose.from_rotvec, vectors, rotvecs)


def assert_same(a: Pose, b: Pose) -> None:
    np.testing.assert_allclose(a.rotation, b.rotation, atol=1e-12)
    np.testing.assert_allclose(a.translation, b.translation, atol=1e-11)


@quick
@given(poses, poses, poses)
def test_poses_form_a_group(a: Pose, b: Pose, c: Pose) -> None:
    assert_same(a.inverse().inverse(), a)
    assert_same(a @ a.inverse(), Pose.identity())
    assert_same(a.inverse() @ a, Pose.identity())
    assert_same((a @ b) @ c, a @ (b @ c))
    assert_same((a @ b).inverse(), b.inverse() @ a.inverse())
    assert_same(a @ Pose.identity(), a)


@quick
@given(poses, poses, arrays(np.float64, (5, 3), elements=st.floats(-10, 10)))
def test_applying_a_product_is_applying_both(a: Pose, b: Pose, points: Array) -> None:
    np.testing.assert_allclose((a @ b).apply(points), a.apply(b.apply(points)), atol=1e-11)
    np.testing.assert_allclose(a.inverse().apply(a.apply(points)), points, atol=1e-11)
    np.testing.assert_allclose(a.apply(points[0]), a.apply(points)[0], atol=1e-12)


@quick
@given(rotvecs)
def test_rotation_vector_and_quaternion_come_back(rotvec: Array) -> None:
    rotation = rotation_from_rotvec(rotvec)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotvec_from_rotation(rotation), rotvec, atol=1e-7)
    q = quaternion_from_rotation(rotation)
    assert q[0] >= 0
    np.testing.assert_allclose(rotation_from_quaternion(q), rotation, atol=1e-12)
    np.testing.assert_allclose(rotation_from_quaternion(-3.0 * q), rotation, atol=1e-12)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0, -0.8), (-0.48, 0.6, 0.64)])
def test_half_a_turn(axis: tuple[float, float, float]) -> None:
    rotation = rotation_from_rotvec(math.pi * np.array(axis))
    assert rotation_angle(rotation) == pytest.approx(math.pi)
    np.testing.assert_allclose(rotation_from_rotvec(rotvec_from_rotation(rotation)), rotation, atol=1e-12)


@pytest.mark.parametrize("size", [0.0, 1e-14, 1e-10, 1e-8, 1e-6, 1e-4])
def test_tiny_turns_keep_their_size(size: float) -> None:
    rotvec = size * np.array([0.6, 0.0, 0.8])
    np.testing.assert_allclose(rotvec_from_rotation(rotation_from_rotvec(rotvec)), rotvec, atol=1e-14, rtol=1e-6)


def test_turns_go_the_right_way() -> None:
    quarter_about_z = rotation_from_rotvec([0.0, 0.0, math.pi / 2])
    np.testing.assert_allclose(quarter_about_z @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    half = math.sqrt(0.5)
    np.testing.assert_allclose(rotation_from_quaternion([half, 0, 0, half]), quarter_about_z, atol=1e-15)


@quick
@given(vectors, vectors)
def test_skew_is_the_cross_product(v: Array, w: Array) -> None:
    np.testing.assert_allclose(skew(v) @ w, np.cross(v, w), atol=1e-12)


@quick
@given(poses, rotvecs)
def test_angle_between_poses_is_the_turn_between_them(a: Pose, rotvec: Array) -> None:
    turned = a @ Pose.from_rotvec(np.zeros(3), rotvec)
    assert a.angle_to(turned) == pytest.approx(float(np.linalg.norm(rotvec)), abs=1e-7)


@pytest.mark.parametrize("q", [(0, 0, 0, 0), (math.nan, 0, 0, 1), (math.inf, 0, 0, 0)])
def test_a_quaternion_without_direction_is_refused(q: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="quaternion"):
        rotation_from_quaternion(q)


def test_a_pose_cannot_be_changed_from_outside() -> None:
    translation = np.zeros(3)
    pose = Pose(np.eye(3), translation)
    translation[0] = 5.0
    assert pose.translation[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        pose.translation[0] = 1.0


@given(arrays(np.float64, 3, elements=st.floats(-4.0, 4.0)) | rotvecs.map(lambda v: 1e-6 * v))
def test_a_rotation_is_the_exponential_of_its_vector(rotvec: Array) -> None:
    k = skew(rotvec)
    power, wanted = np.eye(3), np.eye(3)
    for n in range(1, 45):
        power = power @ k / n
        wanted = wanted + power
    np.testing.assert_allclose(rotation_from_rotvec(rotvec), wanted, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_rotation_by_nothing_known_is_unknown(bad: float) -> None:
    assert np.isnan(rotation_from_rotvec([0.0, bad, 0.0])).all()
