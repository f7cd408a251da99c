"""What was found, drawn in the picture's pixels."""

from __future__ import annotations

import numpy as np

from landtool.camera import Camera
from landtool.io.mcap_annotations import Annotations
from landtool.io.mcap_proto import Built
from landtool.pad import PadSpec
from landtool.panel import BOX, MEASURED, PREDICTED, TAG, TRACKED, distance_m
from landtool.results_log.moment import Moment, ahead
from landtool.strokes import GREY, Color
from landtool.types import Detection, PadPose, TagObservation

_DOT_PX = 3.0


def picture_marks(moment: Moment, height: int, camera: Camera | None, pad: PadSpec | None) -> Built:
    """Return the marks of a picture so many pixels high: boxes, tags, the target's outline, the track's places."""
    marks = Annotations(moment.t_ns, height)
    for box in moment.result.detections:
        _mark_box(marks, box)
    for tag in moment.result.tags:
        _mark_tag(marks, tag)
    if camera is not None and pad is not None:
        for other in moment.result.other_poses:
            _mark_target(marks, other, camera, pad, GREY)
        if moment.result.pose is not None:
            _mark_target(marks, moment.result.pose, camera, pad, MEASURED)
    if camera is not None:
        _mark_tracks(marks, moment, camera)
    return marks.built()


def _mark_box(marks: Annotations, box: Detection) -> None:
    left, top, right, bottom = box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px
    marks.line([(left, top), (right, top), (right, bottom), (left, bottom)], BOX, closed=True)
    marks.text(f"{box.label} {box.score:.2f}", (left, top), BOX)


def _mark_tag(marks: Annotations, tag: TagObservation) -> None:
    marks.line(tag.corners_px, TAG, closed=True)
    marks.text(str(tag.tag_id), tag.corners_px.max(axis=0), TAG)


def _mark_target(marks: Annotations, pose: PadPose, camera: Camera, pad: PadSpec, color: Color) -> None:
    outline_px = camera.project(pose.camera_T_pad.apply(pad.outline_m))
    marks.line(outline_px, color, closed=True)
    seen_px = outline_px[np.isfinite(outline_px).all(axis=1)]
    if len(seen_px):
        # near the end the target is larger than the picture
        place_px = np.clip(seen_px.max(axis=0), 0.0, (0.8 * camera.width, camera.height - 1.0))
        marks.text(f"{pose.method} {distance_m(pose):.2f} m", place_px, color)


def _mark_tracks(marks: Annotations, moment: Moment, camera: Camera) -> None:
    if moment.camera_T_reference is None:
        return
    for track in moment.result.tracks:
        places_m = moment.places_m(track)
        if not len(places_m):
            continue
        places_px = camera.project(moment.camera_T_reference.apply(places_m))
        marks.circle(places_px[0], _DOT_PX, TRACKED)
        marks.line(places_px, PREDICTED)
        for (horizon_s, _), place_px in zip(ahead(track), places_px[1:], strict=True):
            marks.circle(place_px, _DOT_PX, PREDICTED)
            marks.text(f"+{horizon_s:g} s", place_px + _DOT_PX, PREDICTED)
