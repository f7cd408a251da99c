"""The page of plots as an output: track.png."""

from __future__ import annotations

from contextlib import ExitStack
from types import TracebackType

from landtool.io.atomic import atomic_path
from landtool.report.page import draw_page
from landtool.report.page_data import PageData
from landtool.sink import ManagedSink
from landtool.types import Frame, FrameResult, LostFrame

PLOT = "track.png"


class PlotSink(ManagedSink):
    """Draws track.png when the run has ended well; without frames it says that there are none."""

    def _open(self, stack: ExitStack) -> None:
        self._temporary = stack.enter_context(atomic_path(self._setup.folder / PLOT))
        self._data = PageData(has_clock=self._setup.has_clock)

    def write(self, frame: Frame | LostFrame, result: FrameResult) -> None:
        """Take one frame in."""
        self._data.add(result, lost=isinstance(frame, LostFrame))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        """Draw what came, and leave nothing where the run or the drawing failed."""
        if error is not None:
            super().__exit__(kind, error, tb)
            return
        with self._stack:
            recording = self._setup.recording
            title = "landtool track" if recording is None else recording.name
            self._temporary.write_bytes(draw_page(self._data, title=title, nis_dof=self._setup.nis_dof))
