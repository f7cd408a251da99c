"""Poses on rendered truth by distance, mirror poses, time a frame and memory of the near stage."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from apriltag import apriltag

from bench.show import median_ms, table
from landtool.geometry import Pose
from landtool.tags.pose import pad_corners, pad_solutions
from landtool.tags.reader import ReaderConfig, TagReader
from landtool.types import Frame, Image
from tests.method import followed
from tests.scenes import CAMERA, PAD, photograph, view
from tests.unit.landing.test_approach import flips

DISTANCES_M = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
VIEWS = 30
FIXTURE = Path(__file__).parent.parent / "datasets" / "fixtures" / "approach.mp4"


def main() -> None:
    """Print all tables."""
    _poses_by_distance()
    _mirror_poses()
    _time_a_frame()
    _memory()


def _views(distance_m: float) -> list[tuple[Pose, Image]]:
    rng = np.random.default_rng(round(distance_m * 10))
    made = []
    for _ in range(VIEWS):
        azimuth, yaw = rng.uniform(0.0, 2 * np.pi, 2)
        off = (rng.uniform(-0.15, 0.15), rng.uniform(-0.1, 0.1))
        truth = view(distance_m, rng.uniform(0.0, 35.0), azimuth, yaw, off=off)
        made.append((truth, photograph(truth, rng)))
    return made


def _poses_by_distance() -> None:
    """Range and orientation error by three ways to measure the same pictures."""
    reader, library = TagReader(ReaderConfig.of_pad(PAD)), apriltag("tag36h11", decimate=1.0)
    rows = []
    for distance_m in DISTANCES_M:
        ways: dict[str, list[tuple[float, float]]] = {"library": [], "tag": [], "target": []}
        for truth, image in _views(distance_m):
            found = {
                "library": _library_pose(library, image),
                "tag": _tag_pose(reader, image),
                "target": _found_pose(image),
            }
            for way, pose in found.items():
                if pose is not None:
                    ways[way].append(_errors(pose, truth))
        cells = [f"{distance_m:g}", f"{CAMERA.fx * PAD.tag_size_m(PAD.tags[0]) / distance_m:.0f}"]
        for errors in ways.values():
            worst = np.median(np.array(errors), axis=0) if errors else (np.nan, np.nan)
            cells += [f"{len(errors)}/{VIEWS}", f"{worst[0]:.3f}", f"{worst[1]:.2f}"]
        rows.append(cells)
    head = ["m", "px"] + [f"{way} {what}" for way in ("AprilTag", "tag", "landtool") for what in ("n", "range%", "deg")]
    table(
        "Pose, median error by distance; tilt 0-35 degrees, noise 3. AprilTag: whole frame, IPPE, lower error; tag: "
        "registered corners; landtool: with the whole print",
        head,
        rows,
    )


def _library_pose(library: apriltag, image: Image) -> Pose | None:
    found = [tag for tag in library.detect(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)) if tag["id"] == 5]
    if not found:
        return None
    corners = found[0]["lb-rb-rt-lt"][::-1] - 0.5
    points = PAD.tag_corners_m(PAD.tags[0])
    _, rotvecs, places, _ = cv2.solvePnPGeneric(points, corners, CAMERA.matrix, None, flags=cv2.SOLVEPNP_IPPE)
    return Pose.from_rotvec(places[0].ravel(), rotvecs[0].ravel())


def _tag_pose(reader: TagReader, image: Image) -> Pose | None:
    corners = pad_corners(reader.read_frame(image), CAMERA, PAD)
    return None if corners is None else pad_solutions(corners)[0].camera_T_pad


def _found_pose(image: Image) -> Pose | None:
    """The first pose of a run: found by the tag, measured by all of the print."""
    (result,) = followed([Frame(0, 0, image)])
    pose = result.pose
    return None if pose is None else pose.camera_T_pad


def _errors(pose: Pose, truth: Pose) -> tuple[float, float]:
    """Error of the position in percent of the distance, of the orientation in degrees."""
    off = np.linalg.norm(pose.translation - truth.translation) / np.linalg.norm(truth.translation)
    return 100.0 * float(off), float(np.degrees(pose.angle_to(truth)))


def _mirror_poses() -> None:
    """The approach of 1,000 frames from 5 m to 1 m with tilts around 5 degrees."""
    posed, wrong = flips(1000, seed=2)
    table("Mirror poses, approach of 1000 frames", ["frames", "posed", "flipped"], [["1000", str(posed), str(wrong)]])


def _time_a_frame() -> None:
    """The method without a network, target held, against one whole-frame pass of the library, in the same run."""
    library = apriltag("tag36h11", decimate=1.0)
    rows = []
    for distance_m in DISTANCES_M:
        image = photograph(view(distance_m, 8.0, 1.0, 0.5), np.random.default_rng(1))
        results = followed(Frame(i, i * 33_000_000, image) for i in range(10_000))
        next(results)
        held = median_ms(lambda results=results: next(results))
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        whole = median_ms(lambda grey=grey: library.detect(grey), 10)
        rows.append([f"{distance_m:g}", f"{held:.2f}", f"{whole:.1f}", f"{held / whole:.2f}"])
    head = ["m", "tag, pose and track ms", "AprilTag whole frame ms", "ratio"]
    table("Processor time a frame, 640x480, target held", head, rows)


def _memory() -> None:
    """Peak memory of `landtool track` on the shipped clip and on one many times as long."""
    rows = []
    for times in (1, 8):
        with tempfile.TemporaryDirectory() as folder:
            clip = _repeated(Path(folder) / "clip.mp4", times)
            command = [sys.executable, "-c", _MEASURED, str(clip), str(FIXTURE.with_suffix(".camera.yaml")), folder]
            peak_kb = int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        rows.append([str(120 * times), f"{peak_kb / 1024:.0f}"])
    table("Peak memory of a whole run", ["frames", "MB"], rows)


# VmHWM begins anew with the program; getrusage's peak would be that of the process that started it
_MEASURED = """
import contextlib, io, pathlib, sys
from landtool_cli.main import run
with contextlib.redirect_stdout(io.StringIO()):
    code = run(["track", sys.argv[1], "--camera", sys.argv[2], "-o", sys.argv[3] + "/out", "-q"])
assert code == 0, code
lines = pathlib.Path("/proc/self/status").read_text().splitlines()
print(next(line.split()[1] for line in lines if line.startswith("VmHWM")))
"""


def _repeated(path: Path, times: int) -> Path:
    """Write the shipped clip to `path`, forwards and backwards in turn, `times` times as long."""
    from fractions import Fraction

    from landtool.io.video import VideoSource
    from landtool.io.video_out import VideoWriter

    frames = [frame.image for frame in VideoSource(FIXTURE) if isinstance(frame, Frame)]
    with VideoWriter(path, CAMERA.width, CAMERA.height, Fraction(1, 15360)) as video:
        for index in range(len(frames) * times):
            turn, place = divmod(index, len(frames))
            video.write(frames[-1 - place if turn % 2 else place], index * 1_000_000_000 // 30)
    return path
