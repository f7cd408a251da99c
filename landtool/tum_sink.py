"""The sink that writes trajectories as TUM files."""

from __future__ import annotations

from contextlib import ExitStack

from landtool.errors import OutputExistsError, UsageError
from landtool.geometry import Pose
from landtool.io.trajectories import TumWriter
from landtool.sink import ManagedSink
from landtool.types import Frame, FrameResult, LostFrame

# The trajectories by their file, and what each one says of itself
TRAJECTORIES = {
    "pad_in_camera.tum": "the pad as measured, in the camera's frame: x right, y down, z forward",
    "pad_in_world.tum": "the pad as measured, in the world, z up, by the drone's own pose",
    "drone_in_world.tum": "the drone's body (x forward, y left, z up) in the world, as it says itself",
}
_FPS = "give the clock with --fps"
_FIRST_COUNTS = "of several poses of one time the first counts"


class TumSink(ManagedSink):
    """Writes pad_in_camera.tum and, where the drone's own pose is known, pad_in_world.tum and drone_in_world.tum."""

    def _open(self, stack: ExitStack) -> None:
        if not self._setup.has_clock:
            raise UsageError("frames without times make no trajectory", file=self._setup.recording, hint=_FPS)
        for name in TRAJECTORIES:
            if (self._setup.folder / name).exists():
                raise OutputExistsError(self._setup.folder / name)
        self._writers: dict[str, TumWriter] = {}
        self._unturned = 0
        stack.callback(self._take_notes)
        self._writer("pad_in_camera.tum", stack)

    def write(self, frame: Frame | LostFrame, result: FrameResult) -> None:
        """Add the poses of one frame. Raises UsageError for a pose without a time."""
        poses = {
            "pad_in_camera.tum": None if result.pose is None else result.pose.camera_T_pad,
            "pad_in_world.tum": result.world_T_pad,
            "drone_in_world.tum": result.world_T_body,
        }
        for name, pose in poses.items():
            if pose is not None:
                self._add(name, frame, pose)
        self._unturned += result.pose is not None and result.pose.method == "box"

    def _add(self, name: str, frame: Frame | LostFrame, pose: Pose) -> None:
        if frame.t_ns is None:
            reason = f"frame {frame.index} has no time, a trajectory cannot hold it"
            raise UsageError(reason, file=frame.file or None, hint=_FPS)
        self._writer(name, self._stack).write(frame.t_ns, pose)

    def _writer(self, name: str, stack: ExitStack) -> TumWriter:
        if name not in self._writers:
            path = self._setup.folder / name
            self._writers[name] = stack.enter_context(TumWriter(path, (TRAJECTORIES[name], _FIRST_COUNTS)))
        return self._writers[name]

    def _take_notes(self) -> None:
        for name, writer in self._writers.items():
            if writer.left_out:
                self.notes.append(f"{writer.left_out} poses not later than the one before are left out of {name}")
        if self._unturned:
            self.notes.append(
                f"which way {self._unturned} poses of the .tum files are turned is not known: seen as a box"
            )
