"""Annotations and scenes: read back by the schemas' own classes."""

from __future__ import annotations

import numpy as np
import pytest
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from landtool.geometry import Array, Pose, rotation_from_quaternion
from landtool.io.mcap_annotations import Annotations
from landtool.io.mcap_scene import LIFETIME_S, Scene

STAMP_NS = 1_700_000_000_000_000_123
RED = (0, 0, 255)
# roots of covariances whose axes NumPy gives in a right-handed and in a left-handed order
RIGHT = np.array([[0.3, 0.1, 0.0], [0.0, 0.2, 0.05], [0.1, 0.0, 0.4]])
LEFT = np.array([[0.3, -0.3, 0.3], [0.0, -0.4, -0.1], [0.0, 0.1, -0.3]])
SQUARE = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 5.0], [0.0, 5.0]])


def marked(marks: Annotations) -> ImageAnnotations:
    kind, data = marks.built()
    assert kind == "foxglove.ImageAnnotations"
    return ImageAnnotations.FromString(data)


class TestAnnotations:
    def test_the_centre_of_a_pixel_is_half_a_pixel_on(self) -> None:
        marks = Annotations(STAMP_NS, 480)
        marks.line(SQUARE, RED, closed=True)
        marks.circle((3.0, 4.0), 2.0, RED)
        marks.text("5", (7.0, 8.0), RED)
        message = marked(marks)
        [line], [circle], [text] = message.points, message.circles, message.texts
        assert line.type == PointsAnnotation.LINE_LOOP
        assert [(p.x, p.y) for p in line.points] == [(0.5, 0.5), (10.5, 0.5), (10.5, 5.5), (0.5, 5.5)]
        assert (circle.position.x, circle.position.y, circle.diameter) == (3.5, 4.5, 4.0)
        assert (text.position.x, text.position.y, text.text) == (7.5, 8.5, "5")
        assert (line.outline_color.r, line.outline_color.g, line.outline_color.a) == (1.0, 0.0, 1.0)
        for mark in (message, line, circle, text):
            assert mark.timestamp.seconds * 10**9 + mark.timestamp.nanos == STAMP_NS

    def test_what_cannot_be_seen_is_left_out(self) -> None:
        hidden = np.array([np.nan, 1.0])
        marks = Annotations(STAMP_NS, 480)
        marks.line([*SQUARE, hidden], RED, closed=True)
        marks.line([SQUARE[0], hidden], RED)
        marks.circle(hidden, 1.0, RED)
        marks.text("x", hidden, RED)
        message = marked(marks)
        [line] = message.points
        assert (line.type, len(line.points)) == (PointsAnnotation.LINE_STRIP, 4)
        assert (len(message.circles), len(message.texts)) == (0, 0)

    def test_a_picture_without_marks_has_a_message(self) -> None:
        assert marked(Annotations(STAMP_NS, 480)).timestamp.seconds == STAMP_NS // 10**9


class TestScene:
    def test_an_entity_has_its_time_and_ends(self) -> None:
        space = Scene(STAMP_NS)
        entity = space.entity("pad", "camera")
        pose = Pose.from_rotvec((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
        entity.box(pose, (1.0, 2.0, 0.1), RED, 0.5)
        entity.disc(pose, 1.5, 0.01, RED)
        entity.line(np.eye(3), RED, closed=True)
        kind, data = space.built()
        assert kind == "foxglove.SceneUpdate"
        [read] = SceneUpdate.FromString(data).entities
        assert (read.id, read.frame_id, read.lifetime.seconds) == ("pad", "camera", LIFETIME_S)
        assert read.timestamp.seconds * 10**9 + read.timestamp.nanos == STAMP_NS
        [cube], [disc], [line] = read.cubes, read.cylinders, read.lines
        place = cube.pose.position
        assert (place.x, place.y, place.z) == (1.0, 2.0, 3.0)
        assert (cube.size.x, cube.size.y, cube.size.z, cube.color.a) == (1.0, 2.0, 0.1, 0.5)
        assert (disc.size.x, disc.size.y, disc.size.z, disc.top_scale, disc.bottom_scale) == (1.5, 1.5, 0.01, 1.0, 1.0)
        assert line.type == LinePrimitive.LINE_LOOP
        assert [(p.x, p.y, p.z) for p in line.points] == [(1, 0, 0), (0, 1, 0), (0, 0, 1)]

    @pytest.mark.parametrize("root", [RIGHT, LEFT])
    def test_the_ellipsoid_is_that_of_the_covariance(self, root: Array) -> None:
        covariance = root @ root.T
        space = Scene(STAMP_NS)
        space.entity("pad", "camera").ellipsoid(np.zeros(3), covariance, RED)
        [sphere] = SceneUpdate.FromString(space.built().data).entities[0].spheres
        q = sphere.pose.orientation
        axes = rotation_from_quaternion((q.w, q.x, q.y, q.z))
        assert np.linalg.det(axes) == pytest.approx(1.0)
        half = np.array([sphere.size.x, sphere.size.y, sphere.size.z]) / 2.0
        np.testing.assert_allclose(axes @ np.diag(half**2) @ axes.T, covariance, atol=1e-12)
