"""Lines, circles and texts over a picture, as Foxglove's ImageAnnotations."""

from __future__ import annotations

import numpy as np
from foxglove_schemas_protobuf.CircleAnnotation_pb2 import CircleAnnotation
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Point2_pb2 import Point2
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.TextAnnotation_pb2 import TextAnnotation
from numpy.typing import ArrayLike

from landtool.geometry import Array
from landtool.io.mcap_proto import Bgr, Built, built, color, stamp

# Foxglove's pixel (0, 0) spans [0, 1]: its centre is at 0.5, where OpenCV has 0
CENTRE_PX = 0.5
_GROUND: Bgr = (20, 20, 20)


class Annotations:
    """The marks of one picture. Points are in OpenCV's pixels; what is not finite is left out.

    height: of the picture, pixels: lines and letters grow with it.
    """

    def __init__(self, stamp_ns: int, height: int) -> None:
        self._stamp = stamp(stamp_ns)
        self._message = ImageAnnotations(timestamp=self._stamp)
        self._line_px, self._text_px = max(1.0, height / 360.0), max(10.0, height / 34.0)

    def line(self, points_px: ArrayLike, bgr: Bgr, *, closed: bool = False) -> None:
        """Add a line through points (N, 2); with a point that cannot be seen it is open."""
        points = np.asarray(points_px, dtype=np.float64).reshape(-1, 2)
        seen = points[np.isfinite(points).all(axis=1)]
        if len(seen) < 2:
            return
        whole = closed and len(seen) == len(points)
        kind = PointsAnnotation.LINE_LOOP if whole else PointsAnnotation.LINE_STRIP
        mark = PointsAnnotation(timestamp=self._stamp, type=kind, outline_color=color(bgr), thickness=self._line_px)
        mark.points.extend(_point(point) for point in seen)
        self._message.points.append(mark)

    def circle(self, centre_px: ArrayLike, radius_px: float, bgr: Bgr) -> None:
        """Add a circle."""
        centre = np.asarray(centre_px, dtype=np.float64)
        if np.isfinite(centre).all():
            mark = CircleAnnotation(timestamp=self._stamp, position=_point(centre), diameter=2.0 * radius_px)
            mark.thickness = self._line_px
            mark.outline_color.CopyFrom(color(bgr))
            self._message.circles.append(mark)

    def text(self, words: str, place_px: ArrayLike, bgr: Bgr) -> None:
        """Add a text whose bottom left is at a place (2,)."""
        place = np.asarray(place_px, dtype=np.float64)
        if np.isfinite(place).all():
            mark = TextAnnotation(timestamp=self._stamp, position=_point(place), text=words, font_size=self._text_px)
            mark.text_color.CopyFrom(color(bgr))
            mark.background_color.CopyFrom(color(_GROUND, 0.6))
            self._message.texts.append(mark)

    def built(self) -> Built:
        """Return the message; without marks it clears those of the picture before."""
        return built(self._message)


def _point(point_px: Array) -> Point2:
    return Point2(x=float(point_px[0]) + CENTRE_PX, y=float(point_px[1]) + CENTRE_PX)
