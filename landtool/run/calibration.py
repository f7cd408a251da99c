"""One recording of a board to a calibrated camera, with its report."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from landtool.calibrate.board import Board
from landtool.calibrate.calibration import Calibration, NamedView, Verdict, calibrate_views
from landtool.calibrate.corners import Grey, find_board, grey_of
from landtool.calibrate.diagnose import what_differs, why_not_found
from landtool.calibrate.look import FrameChoice
from landtool.calibrate.picture import draw_report
from landtool.calibrate.solve import LEAST_VIEWS
from landtool.calibrate.text import calibration_lines, calibration_values
from landtool.camera import DistortionModel
from landtool.errors import InputError
from landtool.io.atomic import atomic_path, refuse_input_as_output
from landtool.io.calibration import camera_yaml
from landtool.io.prefetch import prefetch
from landtool.io.source import Source, SourceInfo, open_source
from landtool.types import Frame, LostFrame

MODELS: dict[str, DistortionModel] = {
    "plumb_bob": "plumb_bob",
    "rational": "rational_polynomial",
    "fisheye": "equidistant",
}
_AHEAD = 4
_KEPT = 6  # pictures kept to tell what is wrong


@dataclass(frozen=True)
class CalibrateRequest:
    """A recording of a board, and where the camera goes. model: a key of MODELS. read: other files that were read."""

    path: Path
    output: Path
    board: Board
    model: str = "plumb_bob"
    topic: str | None = None
    read: tuple[Path, ...] = ()
    overwrite: bool = False
    on_start: Callable[[SourceInfo], None] | None = None
    on_frame: Callable[[], None] | None = None


@dataclass(frozen=True, eq=False)
class CalibrateOutcome:
    """What came out. exit_code: 0, or 3 when pictures were lost, damaged or of another size.

    looked_at: pictures searched. alike: left out for being like the one before. files: camera, report, numbers.
    """

    calibration: Calibration
    files: tuple[Path, Path, Path]
    frames: int
    looked_at: int
    alike: int
    notes: tuple[str, ...]
    exit_code: int

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes the camera less than it seems, and what was odd, one sentence each."""
        return (*self.notes, *self.calibration.warnings)

    def lines(self) -> list[str]:
        """Return the result as text, a fact a line."""
        looked = f"{self.frames} pictures, {self.looked_at} searched"
        return [
            looked + (f", {self.alike} like the one before" if self.alike else ""),
            *calibration_lines(self.calibration),
        ]


@dataclass
class _Search:
    """What a pass over the recording finds."""

    found: list[NamedView] = field(default_factory=list)
    size: tuple[int, int] = (0, 0)
    frames: int = 0
    looked_at: int = 0
    alike: int = 0
    other_sizes: int = 0
    reasons: dict[str, int] = field(default_factory=dict)
    with_board: list[Grey] = field(default_factory=list)
    without: list[Grey] = field(default_factory=list)


def beside(output: Path) -> tuple[Path, Path]:
    """Return the report's picture and the numbers beside a camera file: same stem, `.report.png` and `.json`."""
    return output.with_suffix(".report.png"), output.with_suffix(".json")


def calibrate(request: CalibrateRequest) -> CalibrateOutcome:
    """Find the board in a recording, calibrate, and write the camera, the report and the numbers, all or none.

    Raises UsageError for an input or output that cannot be, InputError where the board is not found or determines no
    camera, OutputError as `atomic_path` does.
    """
    outputs = (request.output, *beside(request.output))
    for output in outputs:
        refuse_input_as_output([request.path, *request.read], output)
    with ExitStack() as stack:
        camera, picture, numbers = (
            stack.enter_context(atomic_path(output, overwrite=request.overwrite)) for output in outputs
        )
        source = stack.enter_context(open_source(request.path, topic=request.topic))
        if request.on_start is not None:
            request.on_start(source.info)
        search = _search(request, source)
        try:
            calibration, notes = _solve(request, search)
        except InputError as error:
            raise InputError(error.reason, file=request.path, hint=error.hint) from error
        camera.write_text(camera_yaml(calibration.camera), encoding="utf-8")
        picture.write_bytes(draw_report(calibration, request.path.name))
        numbers.write_text(_json(request, search, calibration), encoding="utf-8")
        whole = source.report.complete and not search.other_sizes
        said = (*source.info.notes, *source.report.notes, *notes)
    files = (outputs[0], outputs[1], outputs[2])
    notes_once = tuple(dict.fromkeys(said))
    return CalibrateOutcome(
        calibration, files, search.frames, search.looked_at, search.alike, notes_once, 0 if whole else 3
    )


def _search(request: CalibrateRequest, source: Source) -> _Search:
    search = _Search()
    choice = FrameChoice(source.info.frames_declared)
    with closing(prefetch(iter(source), _AHEAD)) as frames:
        for frame in _of_one_size(frames, search, request.on_frame):
            for picture in choice.take(frame):
                _look(request.board, picture, search)
        for picture in choice.rest():
            _look(request.board, picture, search)
    search.alike = choice.alike
    return search


def _of_one_size(
    frames: Iterator[Frame | LostFrame], search: _Search, on_frame: Callable[[], None] | None
) -> Iterator[Frame]:
    """Give on undamaged pictures of the first one's size; count the rest."""
    for frame in frames:
        search.frames += 1
        if on_frame is not None:
            on_frame()
        if isinstance(frame, LostFrame) or frame.damage:
            continue
        size = frame.image.shape[1], frame.image.shape[0]
        if search.size == (0, 0):
            search.size = size
        if size != search.size:
            search.other_sizes += 1
            continue
        yield frame


def _look(board: Board, frame: Frame, search: _Search) -> None:
    seen = find_board(frame.image, board)
    search.looked_at += 1
    if seen.view is not None:
        search.found.append(NamedView(frame.index, frame.file, seen.view))
        kept = search.with_board
    else:
        search.reasons[seen.reason] = search.reasons.get(seen.reason, 0) + 1
        kept = search.without
    # the first ones, then ones ever further apart
    if len(kept) < _KEPT:
        kept.append(grey_of(frame.image))
    elif search.looked_at % 20 == 0:
        kept[search.looked_at // 20 % _KEPT] = grey_of(frame.image)


def _solve(request: CalibrateRequest, search: _Search) -> tuple[Calibration, list[str]]:
    board = request.board
    if not search.looked_at:
        raise InputError("holds no undamaged picture", hint="record it again")
    if len(search.found) < LEAST_VIEWS:
        seen = why_not_found(board, search.without)
        count = f"{len(search.found)} of {search.looked_at} pictures" if search.found else "none of its pictures"
        hint = seen or "film the whole board, sharp, flat and well lit, and check --board and --squares"
        raise InputError(f"a {board.kind} of {board.size} is found in {count}, {LEAST_VIEWS} are needed", hint=hint)
    calibration = calibrate_views(board, search.found, search.size, MODELS[request.model])
    differs = what_differs(board, search.with_board[:3])
    if differs:
        verdict: Verdict = "usable" if calibration.verdict == "good" else "poor"
        calibration = replace(calibration, warnings=(*differs, *calibration.warnings), verdict=verdict)
    notes = []
    if search.other_sizes:
        width, height = search.size
        notes.append(f"{search.other_sizes} pictures are not {width}x{height} as the first one and were left out")
    return calibration, notes


def _json(request: CalibrateRequest, search: _Search, calibration: Calibration) -> str:
    values = {
        "input": str(request.path),
        "frames": search.frames,
        "looked_at": search.looked_at,
        "alike": search.alike,
        "found": len(search.found),
        "not_found": dict(sorted(search.reasons.items())),
        **calibration_values(calibration),
    }
    return json.dumps(_finite(values), indent=1, allow_nan=False) + "\n"


def _finite(value: object) -> object:
    """Return plain values with None for what is no finite number."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
