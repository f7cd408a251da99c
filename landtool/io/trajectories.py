"""Trajectories in TUM's format, which evo and others read."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from landtool.geometry import Pose
from landtool.io.atomic import atomic_path
from landtool.io.managed import Managed

_COLUMNS = "t_s tx_m ty_m tz_m qx qy qz qw"


class TumWriter(Managed):
    """Writes one trajectory: a pose a line, `t tx ty tz qx qy qz qw`, in seconds and metres, by rising time.

    comments: lines at the file's beginning. Readers want times that rise, so of several poses of one time the first
    counts, and one from before the last is left out: `left_out` counts both. The file appears when the block ends
    well. Raises OutputExistsError and OutputError as `atomic_path` does.
    """

    def __init__(self, path: Path, comments: Sequence[str] = ()) -> None:
        super().__init__()
        self.path, self.left_out = path, 0
        self._comments = comments
        self._last_ns: int | None = None

    def write(self, t_ns: int, pose: Pose) -> None:
        """Add a pose."""
        if self._last_ns is not None and t_ns <= self._last_ns:
            self.left_out += 1
            return
        self._last_ns = t_ns
        w, x, y, z = pose.quaternion_wxyz.tolist()
        values = " ".join(f"{value + 0.0:.9g}" for value in (*pose.translation.tolist(), x, y, z, w))
        self._file.write(f"{_seconds(t_ns)} {values}\n")

    def _open(self, stack: ExitStack) -> None:
        temporary = stack.enter_context(atomic_path(self.path))
        self._file = stack.enter_context(temporary.open("w", encoding="utf-8", newline=""))
        self._file.writelines(f"# {line}\n" for line in (*self._comments, _COLUMNS))


def _seconds(t_ns: int) -> str:
    """Return nanoseconds as seconds, exactly: a float holds seconds since 1970 to 0.2 microseconds only."""
    whole, rest = divmod(abs(t_ns), 1_000_000_000)
    return f"{'-' if t_ns < 0 else ''}{whole}.{rest:09d}"
