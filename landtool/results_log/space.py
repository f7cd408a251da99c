"""What was found, in space: the pad, how sure its place is, the tracks and their predictions."""

from __future__ import annotations

import numpy as np

from landtool.geometry import Pose
from landtool.io.mcap_build import Motion, Transform
from landtool.io.mcap_proto import Built
from landtool.io.mcap_scene import Entity, Scene
from landtool.pad import WHITE, PadSpec
from landtool.panel import MEASURED, PREDICTED, TRACKED
from landtool.results_log.moment import Moment
from landtool.results_log.topics import BODY, CAMERA, MAP, PAD, PLATFORM, REFERENCES
from landtool.types import PadPose, Track

_SHEET = 0.01  # thickness of what is printed, in diameters: enough to be seen from the side
_FAINT = 0.35


def transforms(moment: Moment, body_T_camera: Pose | None) -> list[Transform]:
    """Return the tree of frames as far as it is known now."""
    result, track = moment.result, moment.track
    edges: list[Transform] = []
    if result.world_T_body is not None:
        edges.append(Transform(MAP, BODY, result.world_T_body))
    if body_T_camera is not None:
        edges.append(Transform(BODY, CAMERA, body_T_camera))
    if result.pose is not None:
        edges.append(Transform(CAMERA, PAD, result.pose.camera_T_pad))
    if track is not None and len(places := moment.places_m(track)):
        edges.append(Transform(REFERENCES[track.reference], PLATFORM, Pose(np.eye(3), places[0])))
    return edges


def odometry(moment: Moment, track: Track) -> Motion | None:
    """Return a track as an odometry whose axes are the reference frame's; None where its height is unknown."""
    places = moment.places_m(track)
    if not len(places):
        return None
    where, how_fast = np.zeros((6, 6)), np.zeros((6, 6))
    where[:2, :2], how_fast[:2, :2] = track.covariance[:2, :2], track.covariance[2:, 2:]
    twist = (float(track.state[2]), float(track.state[3]), 0.0, 0.0, 0.0, 0.0)
    return Motion(REFERENCES[track.reference], PLATFORM, Pose(np.eye(3), places[0]), twist, where, how_fast)


def scene(moment: Moment, pad: PadSpec) -> Built:
    """Return the bodies of a moment: pads and their ellipsoids in the camera's frame, tracks in their own."""
    space = Scene(moment.t_ns)
    if moment.result.pose is not None:
        _place_pad(space, "pad", moment.result.pose, pad)
    for number, other in enumerate(moment.result.other_poses, start=2):
        _place_pad(space, f"pad {number}", other, pad)
    for track in moment.result.tracks:
        _place_track(space, moment, track, pad)
    return space.built()


def _place_pad(space: Scene, name: str, pose: PadPose, pad: PadSpec) -> None:
    entity = space.entity(name, CAMERA)
    camera_T_pad = pose.camera_T_pad
    # which way it lies is not known from a box
    alpha = _FAINT if pose.method == "box" else 1.0
    _lay_sheets(entity, camera_T_pad, pad, alpha)
    entity.ellipsoid(camera_T_pad.translation, pose.covariance[:3, :3], MEASURED, _FAINT)


def _lay_sheets(entity: Entity, camera_T_pad: Pose, pad: PadSpec, alpha: float) -> None:
    """Lay the board, the ring and the H as thin sheets, each higher than the one before."""
    d, sheet = pad.diameter_m, _SHEET * pad.diameter_m

    def at(height_m: float) -> Pose:
        return camera_T_pad @ Pose(np.eye(3), np.array([0.0, 0.0, height_m]))

    board = pad.board
    side = board.side * d if board else pad.extent_m
    entity.box(at(-sheet), (side, side, sheet), _bgr(board.color if board else WHITE), alpha)
    if pad.ring:
        entity.disc(at(0.0), pad.ring.outer * d, sheet, _bgr(pad.ring.color), alpha)
        entity.disc(at(sheet), pad.ring.inner * d, sheet, _bgr(board.color if board else WHITE), alpha)
    if pad.letter:
        flat = np.column_stack([pad.letter_outline_m, np.zeros(len(pad.letter_outline_m))])
        entity.line(at(2.0 * sheet).apply(flat), _bgr(pad.letter.color), closed=True)


def _place_track(space: Scene, moment: Moment, track: Track, pad: PadSpec) -> None:
    places = moment.places_m(track)
    if not len(places):
        return
    entity = space.entity(f"track {track.track_id}", REFERENCES[track.reference])
    spread = np.zeros((3, 3))
    spread[:2, :2] = track.covariance[:2, :2]
    spread[2, 2] = (_SHEET * pad.diameter_m) ** 2  # flat, but not so flat that it cannot be seen
    entity.ellipsoid(places[0], spread, TRACKED, _FAINT)
    entity.line(places, PREDICTED)
    for place in places[1:]:
        entity.disc(Pose(np.eye(3), place), 0.1 * pad.diameter_m, _SHEET * pad.diameter_m, PREDICTED)


def _bgr(rgb: tuple[int, int, int]) -> tuple[int, int, int]:
    return rgb[2], rgb[1], rgb[0]
