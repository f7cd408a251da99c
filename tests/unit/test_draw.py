from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from landtool.camera import Camera
from landtool.draw import Overlay, label_place, main_track
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.panel import BOX, MEASURED, PREDICTED, TAG, TRACKED, lateral_m, panel_lines
from landtool.strokes import VERMILLION, Color, Pen, ascii_only
from landtool.types import Detection, Frame, FrameResult, Image, PadPose, TagObservation, Track, TrackState

PAD = PadSpec()
CAMERA = Camera(640, 480, 554.0, 554.0, 319.5, 239.5, distortion=(-0.25, 0.08, 0.001, -0.001, 0.0))
# a camera 4 m above the origin of the world looking straight down, image top along the world's x (pad.md)
DOWN = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
CAMERA_T_WORLD = Pose(DOWN, np.zeros(3)) @ Pose(np.eye(3), np.array([0.0, 0.0, -4.0]))
WORLD_T_PAD = Pose.from_rotvec([-0.2, -0.4, 0.5], [0.0, 0.0, 0.6])
GROUND = 128


def picture(width: int = 640, height: int = 480) -> Image:
    return np.full((height, width, 3), GROUND, np.uint8)


def a_frame(index: int = 0, t_ns: int | None = 0, image: Image | None = None, damage: str = "") -> Frame:
    return Frame(index, t_ns, picture() if image is None else image, damage=damage)


def a_pose(camera_T_pad: Pose | None = None) -> PadPose:
    return PadPose(camera_T_pad or CAMERA_T_WORLD @ WORLD_T_PAD, np.eye(6) * 1e-4, "tag", 0.2, 0.1)


def a_track(track_id: int = 1, status: TrackState = "confirmed", x: float = -0.2, y: float = -0.4) -> Track:
    covariance = np.diag([0.09, 0.01, 0.1, 0.1])
    return Track(track_id, status, "world", np.array([x, y, 1.0, 0.0]), covariance, 1.0, 0.5, np.array([x + 0.5, y]))


def pixels_of(points_world: Array) -> Array:
    return CAMERA.project(CAMERA_T_WORLD.apply(points_world))


def painted(image: Image, color: Color, near: int = 60) -> NDArray[np.bool_]:
    """Where the picture has about this colour."""
    distance = np.abs(image.astype(int) - np.array(color)).sum(axis=2)
    return np.asarray(distance < near)


def near_line(image: Image, points_px: Array, color: Color) -> float:
    """Share of points (N, 2) with the colour within 1.5 pixels."""
    wide = cv2.dilate(painted(image, color).astype(np.uint8), np.ones((3, 3), np.uint8))
    columns, rows = np.round(points_px).astype(int).T
    return float(wide[rows, columns].mean())


def outside_panel(image: Image) -> Image:
    """The picture with its panel painted over."""
    image = image.copy()
    image[:170, :200] = GROUND
    return image


class TestTarget:
    def test_the_outline_lies_on_the_projected_edges(self) -> None:
        pose = a_pose()
        image = Overlay(CAMERA, PAD).draw(a_frame(), FrameResult(0, 0, pose=pose))
        ring = CAMERA.project(pose.camera_T_pad.apply(PAD.outline_m))
        assert near_line(image, ring, MEASURED) > 0.9
        half = 1.1 / 2
        board = CAMERA.project(pose.camera_T_pad.apply([[half, v, 0.0] for v in np.linspace(-half, half, 30)]))
        assert near_line(image, board, MEASURED) > 0.9
        # and nowhere else: all of the colour is within the board's circle
        rows, columns = np.nonzero(painted(outside_panel(image), MEASURED))
        centre = CAMERA.project(pose.camera_T_pad.translation)[0]
        radius = np.abs(board - centre).max() * math.sqrt(2) + 4
        assert np.hypot(columns - centre[0], rows - centre[1]).max() < radius

    def test_the_lens_bends_the_outline(self) -> None:
        pose = a_pose(Pose(DOWN, np.array([1.2, 0.8, 2.5])))
        flat = replace(CAMERA, distortion=(0.0, 0.0, 0.0, 0.0, 0.0))
        image = Overlay(CAMERA, PAD).draw(a_frame(), FrameResult(0, 0, pose=pose))
        inside = [
            ring[(ring > 3).all(axis=1) & (ring < (636, 476)).all(axis=1)]
            for ring in (camera.project(pose.camera_T_pad.apply(PAD.outline_m)) for camera in (CAMERA, flat))
        ]
        assert near_line(image, inside[0], MEASURED) > 0.9
        assert near_line(image, inside[1], MEASURED) < 0.3

    def test_axes_point_along_the_print(self) -> None:
        pose = a_pose(Pose(DOWN, np.array([0.0, 0.0, 2.5])))
        image = Overlay(CAMERA, PAD).draw(a_frame(), FrameResult(0, 0, pose=pose))
        rows, columns = np.nonzero(painted(image, VERMILLION))
        assert rows.size > 50
        assert abs(np.median(columns) - 319.5) < 2  # x of the pad is up in the image
        assert rows.max() < 245

    def test_a_distant_target_is_not_covered(self) -> None:
        near, far = (Pose(DOWN, np.array([0.0, 0.0, z])) for z in (3.0, 20.0))
        for pose, expected in ((near, True), (far, False)):
            image = Overlay(CAMERA, PAD).draw(a_frame(), FrameResult(0, 0, pose=a_pose(pose)))
            assert painted(image, VERMILLION).any() == expected
            assert painted(outside_panel(image), MEASURED).any()

    @pytest.mark.parametrize("z", [0.02, 0.3, -1.0])
    def test_a_target_that_fills_or_leaves_the_view(self, z: float) -> None:
        tilted = Pose.from_rotvec([0.1, 0.1, z], [2.8, 0.3, 0.0])
        image = Overlay(CAMERA, PAD).draw(a_frame(), FrameResult(0, 0, pose=a_pose(tilted)))
        assert image.shape == (480, 640, 3)


class TestPixels:
    def test_boxes_and_tags_need_no_camera(self) -> None:
        corners = np.array([[300.0, 200.0], [340.0, 205.0], [335.0, 245.0], [295.0, 240.0]])
        tag = TagObservation("tag36h11", 5, 0, 60.0, corners, 0.01 * np.eye(8))
        box = Detection("pad", 0.9, 250.0, 150.0, 420.0, 330.0)
        result = FrameResult(0, None, detections=(box,), tags=(tag,), pose=a_pose(), tracks=(a_track(),))
        image = Overlay().draw(a_frame(t_ns=None), result, CAMERA_T_WORLD)
        edges = np.linspace(corners, np.roll(corners, -1, axis=0), 10).reshape(-1, 2)
        assert near_line(image, edges, TAG) > 0.9
        side = np.column_stack([np.full(20, 420.0), np.linspace(155, 325, 20)])
        assert near_line(image, side, BOX) == 1.0
        assert not painted(outside_panel(image), MEASURED).any()

    @pytest.mark.parametrize("box", [(-50.0, -50.0, 900.0, 700.0), (630.0, 470.0, 639.5, 479.5), (0.0, 0.0, 1.0, 1.0)])
    def test_labels_stay_in_the_image(self, box: tuple[float, float, float, float]) -> None:
        blank = picture()
        image = Overlay().draw(a_frame(image=blank), FrameResult(0, 0, detections=(Detection("pad", 0.5, *box),)))
        ground = Pen.of_image(640, 480).text_width("pad 0.50") * 13
        assert painted(image, BOX).sum() > ground * 0.5  # the letters and the panel's corner take the rest

    @pytest.mark.parametrize(
        "box",
        [
            (300.0, 200.0, 312.0, 212.0),  # far away
            (300.0, -0.5, 420.0, 120.0),  # at the top: no room above
            (20.0, 30.0, 150.0, 160.0),  # under the panel
            (250.0, -0.5, 460.0, 479.5),  # from top to bottom
            (-0.5, -0.5, 300.0, 479.5),  # the left half
        ],
    )
    def test_no_box_is_covered_by_its_line_or_its_label(self, box: tuple[float, float, float, float]) -> None:
        pen, seen, panel = Pen.of_image(640, 480), Detection("pad", 0.9, *box), (210, 120)
        width, height = pen.text_width("pad 0.90") + 6, pen.text_px + 3
        left, bottom = label_place(seen, pen, width, panel)
        assert 0 <= left <= 640 - width
        assert height <= bottom <= 480
        assert left + width <= box[0] or left >= box[2] or bottom <= box[1] or bottom - height >= box[3]
        assert left >= panel[0] or bottom - height >= panel[1], "the panel would hide it"
        image = Overlay().draw(a_frame(), FrameResult(0, 0, detections=(seen,)))
        # a box that ends with the picture has its line inside it; the panel covers what is under it
        left, top, right, bottom = np.clip(box, [4, 130, 0, 0], [640, 480, 635, 475]).round().astype(int)
        inside = np.s_[top + 3 : bottom - 2, left + 3 : right - 2]
        assert (image[inside] == GROUND).all()

    def test_the_frame_itself_is_not_changed(self) -> None:
        blank = picture()
        image = Overlay(CAMERA, PAD).draw(a_frame(image=blank), FrameResult(0, 0, pose=a_pose()))
        assert (blank == GROUND).all()
        assert (image != blank).any()


class TestTracks:
    def draw(self, overlay: Overlay, t_s: float, *tracks: Track, pose: PadPose | None = None) -> Image:
        t_ns = round(t_s * 1e9)
        return overlay.draw(a_frame(0, t_ns), FrameResult(0, t_ns, pose=pose, tracks=tracks), CAMERA_T_WORLD)

    def test_ellipse_and_prediction_are_where_they_are(self) -> None:
        track = a_track()
        image = self.draw(Overlay(CAMERA, PAD), 0.0, track, pose=a_pose())
        angle = np.linspace(0, 2 * np.pi, 60)
        ellipse = np.column_stack([-0.2 + 0.3 * np.cos(angle), -0.4 + 0.1 * np.sin(angle), np.full(60, 0.5)])
        assert near_line(image, pixels_of(ellipse), TRACKED) > 0.75  # the axes cross it
        there = pixels_of(np.array([[0.3, -0.4, 0.5]]))[0]
        rows, columns = np.nonzero(painted(image[:, 200:], PREDICTED))
        assert np.hypot(columns + 200 - there[0], rows - there[1]).min() < 8
        assert rows.min() < there[1]

    def test_a_coasting_track_keeps_the_last_height(self) -> None:
        overlay = Overlay(CAMERA, PAD)
        assert not painted(outside_panel(self.draw(overlay, 0.0, a_track())), TRACKED).any()  # height never seen
        self.draw(overlay, 0.1, a_track(), pose=a_pose())
        image = self.draw(overlay, 0.2, a_track(status="coasting"))
        place = pixels_of(np.array([[-0.2, -0.4, 0.5]]))
        assert near_line(image, place, TRACKED) == 1.0
        assert not painted(outside_panel(image), MEASURED).any()

    def test_no_track_without_its_frame(self) -> None:
        result = FrameResult(0, 0, pose=a_pose(), tracks=(a_track(),))
        image = Overlay(CAMERA, PAD).draw(a_frame(), result)
        assert not painted(outside_panel(image), TRACKED).any()

    def trail_end_s(self, times_s: list[float], ids: list[int]) -> float:
        """Draw a track that goes 1 m/s to the left of the image; return when it was where its trail begins."""
        overlay = Overlay(CAMERA, PAD)
        for t, track_id in zip(times_s, ids, strict=True):
            track = replace(a_track(track_id, y=t - 1.2), covariance=np.eye(4) * 1e-6)
            track = replace(track, predicted_xy_m=track.state[:2])
            image = self.draw(
                overlay, t, track, pose=a_pose(CAMERA_T_WORLD @ Pose(np.eye(3), np.array([-0.2, t - 1.2, 0.5])))
            )
        moments = np.linspace(0.0, times_s[-1], 301)
        places = pixels_of(np.column_stack([np.full(301, -0.2), moments - 1.2, np.full(301, 0.5)]))
        columns = np.nonzero(painted(outside_panel(image), TRACKED))[1]
        return float(moments[np.argmin(np.abs(places[:, 0] - columns.max()))])

    def test_the_trail_is_two_seconds_long_and_belongs_to_one_track(self) -> None:
        times = [0.1 * i for i in range(31)]
        assert self.trail_end_s(times[:11], [1] * 11) == pytest.approx(0.0, abs=0.03)
        assert self.trail_end_s(times, [1] * 31) == pytest.approx(1.0, abs=0.03)
        assert self.trail_end_s(times, [1] * 26 + [2] * 5) == pytest.approx(2.6, abs=0.03)

    def test_main_track(self) -> None:
        tracks = (a_track(1, "tentative"), a_track(2, "coasting"), a_track(4), a_track(3))
        assert main_track(tracks) is tracks[3]
        assert main_track(tracks[:2]) is tracks[1]
        assert main_track(()) is None


class TestPanel:
    def values(self, result: FrameResult, reference: Pose | None = None, metric: bool = True) -> dict[str, str]:
        lines = panel_lines(result, main_track(result.tracks), reference, None, metric=metric)
        return {line.name: line.value for line in lines}

    def test_numbers(self) -> None:
        result = FrameResult(12, 2_500_000_000, stage="near", search="region", pose=a_pose(), tracks=(a_track(),))
        values = self.values(result, CAMERA_T_WORLD)
        assert values["#12"] == "2.500 s"
        assert values["stage"] == "near / region"
        assert values["distance"] == f"{math.sqrt(0.2**2 + 0.4**2 + 3.5**2):.2f} m"
        assert values["lateral"] == f"{math.hypot(0.2, 0.4):.2f} m"
        assert values["speed"] == "1.00 m/s"
        assert values["track 1"] == "confirmed"
        assert values["prediction"] == "+0.5 s"

    def test_a_track_that_is_not_proven_has_no_speed(self) -> None:
        values = self.values(FrameResult(0, 0, tracks=(a_track(1, "tentative"),)))
        assert (values["speed"], values["track 1"]) == ("--", "tentative")

    def test_nothing_known(self) -> None:
        values = self.values(FrameResult(0, None))
        assert set(values.values()) == {"--"}
        assert self.values(FrameResult(0, None), metric=False)["tags"] == "0"

    def test_speed_in_the_body_frame_is_called_relative(self) -> None:
        track = replace(a_track(), reference="body")
        assert "rel. speed" in self.values(FrameResult(0, 0, tracks=(track,)))

    def test_lateral_is_across_the_vertical_of_the_reference(self) -> None:
        # a camera tilted by 30 degrees sees a pad on its own axis: half the distance to the side
        tilt = Pose.from_rotvec(np.zeros(3), [math.radians(30), 0.0, 0.0])
        pose = a_pose(Pose(DOWN, np.array([0.0, 0.0, 4.0])))
        assert lateral_m(pose, None) == pytest.approx(0.0)
        assert lateral_m(pose, tilt @ CAMERA_T_WORLD) == pytest.approx(2.0)

    def test_the_rate_is_a_mean_of_the_work_of_the_last_frames(self) -> None:
        slow, quick = Overlay(), Overlay()
        images = [
            overlay.draw(a_frame(), FrameResult(0, 0, stage_seconds={"tags": seconds, "pose": seconds}))
            for overlay, seconds in ((slow, 0.1), (quick, 0.001))
        ]
        assert (images[0] != images[1]).any()
        for _ in range(30):
            last = slow.draw(a_frame(), FrameResult(0, 0, stage_seconds={"tags": 0.001, "pose": 0.001}))
        np.testing.assert_array_equal(last, images[1])

    @pytest.mark.parametrize("size", [(640, 480), (1920, 1080), (1080, 1920), (3840, 2160), (320, 240)])
    def test_darkens_a_corner_and_leaves_the_rest(self, size: tuple[int, int]) -> None:
        width, height = size
        image = Overlay().draw(a_frame(image=picture(width, height)), FrameResult(0, 0))
        rows, columns = np.nonzero((image != GROUND).any(axis=2))
        assert columns.min() >= 2
        assert rows.min() >= 2
        assert columns.max() < 0.6 * width
        assert rows.max() < 0.6 * height
        assert image.max() > 230  # letters

    @pytest.mark.parametrize("size", [(1, 1), (7, 300), (64, 48), (300, 7), (33, 17)])
    def test_images_too_small_for_it(self, size: tuple[int, int]) -> None:
        box = Detection("pad", 0.5, 0.0, 0.0, 5.0, 5.0)
        result = FrameResult(0, 0, pose=a_pose(), tracks=(a_track(),), detections=(box,))
        frame = a_frame(image=picture(*size), damage="cut")
        image = Overlay(CAMERA.scaled(*size), PAD).draw(frame, result, CAMERA_T_WORLD)
        assert image.shape == (size[1], size[0], 3)

    def test_damage_is_marked(self) -> None:
        for frame, result in (
            (a_frame(damage="3 macroblocks concealed"), FrameResult(0, 0)),
            (a_frame(), FrameResult(0, 0, status="damaged", reason="x" * 500)),
        ):
            strip = Overlay().draw(frame, result)[-10:]
            assert painted(strip, VERMILLION).mean() > 0.3
        assert not painted(Overlay().draw(a_frame(), FrameResult(0, 0)), VERMILLION).any()


def test_text_is_one_line_of_ascii() -> None:
    assert ascii_only("a\tb\n  c\u00e9\x07") == "a b c??"


class TestPen:
    def test_points_along_a_straight_line_change_nothing(self) -> None:
        pen, few, many = Pen.of_image(640, 480), picture(), picture()
        corners = np.array([[100.0, 80.0], [500.0, 80.0], [500.0, 400.0], [100.0, 400.0]])
        share = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None]
        dense = np.concatenate([a + share * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)])
        pen.line(few, corners, MEASURED, closed=True)
        pen.line(many, dense, MEASURED, closed=True)
        np.testing.assert_array_equal(few, many)

    @pytest.mark.parametrize("radius", [5.0, 40.0, 200.0])
    def test_a_circle_stays_round(self, radius: float) -> None:
        pen, image = Pen.of_image(640, 480), picture()
        angle = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
        pen.line(image, 240.0 + radius * np.column_stack([np.cos(angle), np.sin(angle)]), MEASURED, closed=True)
        rows, columns = np.nonzero(painted(image, MEASURED))
        # a 48-sided figure is itself up to r (1 - cos(pi / 48)) inside the circle
        off = np.abs(np.hypot(rows - 240.0, columns - 240.0) - radius)
        assert off.max() < 1.5 + pen.line_px / 2 + 0.0022 * radius

    @pytest.mark.parametrize("text", ["plain", " two  words ", "caf\u00e9", "a\tb", "bell\x07"])
    def test_what_cannot_be_written_becomes_a_question_mark(self, text: str) -> None:
        assert ascii_only(text) == "".join(c if " " <= c <= "~" else "?" for c in " ".join(text.split()))
