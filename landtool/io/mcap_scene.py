"""Bodies and lines in space, as Foxglove's SceneUpdate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from foxglove_schemas_protobuf.CubePrimitive_pb2 import CubePrimitive
from foxglove_schemas_protobuf.CylinderPrimitive_pb2 import CylinderPrimitive
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.SpherePrimitive_pb2 import SpherePrimitive
from google.protobuf.duration_pb2 import Duration

from landtool.geometry import Array, Pose
from landtool.io.mcap_proto import Bgr, Built, built, color, proto_pose, stamp, vector

LIFETIME_S = 1  # what was not seen for so long is not there any more
_LINE_PX = 3.0


class Scene:
    """What is known in space at one time. An entity stays until one of its name follows, or for `LIFETIME_S`."""

    def __init__(self, stamp_ns: int) -> None:
        self._stamp = stamp(stamp_ns)
        self._message = SceneUpdate()

    def entity(self, name: str, frame_id: str) -> Entity:
        """Begin an entity, whose poses are in the frame `frame_id`."""
        held = self._message.entities.add()
        held.timestamp.CopyFrom(self._stamp)
        held.frame_id, held.id = frame_id, name
        held.lifetime.CopyFrom(Duration(seconds=LIFETIME_S))
        return Entity(held)

    def built(self) -> Built:
        """Return the message."""
        return built(self._message)


class Entity:
    """One thing of a scene, of several bodies. Poses are in its frame, sizes in metres."""

    def __init__(self, message: SceneEntity) -> None:
        self._message = message

    def box(self, pose: Pose, size_m: Sequence[float], bgr: Bgr, alpha: float = 1.0) -> None:
        """Add a box by its centre."""
        self._message.cubes.append(CubePrimitive(pose=proto_pose(pose), size=vector(size_m), color=color(bgr, alpha)))

    def disc(self, pose: Pose, diameter_m: float, thickness_m: float, bgr: Bgr, alpha: float = 1.0) -> None:
        """Add a flat cylinder by its centre, its axis along z."""
        size = vector((diameter_m, diameter_m, thickness_m))
        disc = CylinderPrimitive(pose=proto_pose(pose), size=size, color=color(bgr, alpha))
        disc.bottom_scale = disc.top_scale = 1.0
        self._message.cylinders.append(disc)

    def ellipsoid(self, centre_m: Array, covariance: Array, bgr: Bgr, alpha: float = 1.0) -> None:
        """Add the 1-sigma ellipsoid of a covariance (3, 3) m^2 about a place (3,)."""
        # C = V L V^T: half axes sqrt(L) along the columns of V, turned to a right-handed frame
        values, vectors = np.linalg.eigh(covariance)
        vectors[:, 0] *= np.sign(np.linalg.det(vectors))
        size = vector((2.0 * np.sqrt(np.maximum(values, 0.0))).tolist())
        pose = proto_pose(Pose(vectors, centre_m))
        self._message.spheres.append(SpherePrimitive(pose=pose, size=size, color=color(bgr, alpha)))

    def line(self, points_m: Array, bgr: Bgr, *, closed: bool = False) -> None:
        """Add a line through points (N, 3), of the same width from everywhere."""
        kind = LinePrimitive.LINE_LOOP if closed else LinePrimitive.LINE_STRIP
        line = LinePrimitive(type=kind, pose=proto_pose(Pose.identity()), thickness=_LINE_PX, scale_invariant=True)
        line.color.CopyFrom(color(bgr))
        line.points.extend(Point3(x=x, y=y, z=z) for x, y, z in points_m.tolist())
        self._message.lines.append(line)
