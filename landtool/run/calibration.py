"""One recording of a board to a calibrated camera, with its report."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from landtool.calibrate.board import Board
from landtool.calibrate.calibration import Calibration, NamedView, Refused, Verdict, calibrate_views
from landtool.calibrate.corners import Grey, find_board, grey_of
from landtool.calibrate.diagnose import what_differs, why_not_found
from landtool.calibrate.look import FrameChoice
from landtool.calibrate.models import MODELS, better_model
from landtool.calibrate.picture import draw_report
from landtool.calibrate.solve import LEAST_VIEWS
from landtool.calibrate.text import calibration_lines, calibration_values
from landtool.errors import InputError, UsageError
from landtool.io.atomic import atomic_path, refuse_input_as_output
from landtool.io.calibration import camera_yaml
from landtool.io.prefetch import prefetch
from landtool.io.source import Source, SourceInfo, open_source
from landtool.types import Frame, LostFrame

SUFFIXES = (".yaml", ".yml")
_AHEAD = 4
_NAMED = 3  # pictures left out that are named
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
    """What came out. exit_code: 0, or 3 for a poor camera, or when pictures were lost, damaged or of another size.

    looked_at: pictures searched. found: those that show the board. alike: left out for being like the one before.
    files: camera, report, numbers.
    """

    calibration: Calibration
    files: tuple[Path, Path, Path]
    frames: int
    looked_at: int
    found: int
    alike: int
    notes: tuple[str, ...]
    exit_code: int

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes the camera less than it seems, and what was odd, one sentence each."""
        return (*self.notes, *self.calibration.warnings)

    def lines(self) -> list[str]:
        """Return the result as text, a fact a line."""
        looked = f"{pictures(self.frames)}, {self.looked_at} searched"
        return [
            looked + (f", {self.alike} like the one before" if self.alike else ""),
            f"board found in {self.found} of {pictures(self.looked_at)}",
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
    lost: list[Refused] = field(default_factory=list)
    other_sizes: list[Refused] = field(default_factory=list)
    reasons: dict[str, int] = field(default_factory=dict)
    with_board: list[Grey] = field(default_factory=list)
    without: list[Grey] = field(default_factory=list)


def pictures(count: int) -> str:
    """Return a number of pictures in words."""
    return f"{count} picture" if count == 1 else f"{count} pictures"


def beside(output: Path) -> tuple[Path, Path]:
    """Return the report's picture and the numbers beside a camera file: same stem, `.report.png` and `.json`."""
    return output.with_suffix(".report.png"), output.with_suffix(".json")


def calibrate(request: CalibrateRequest) -> CalibrateOutcome:
    """Find the board in a recording, calibrate, and write the camera, the report and the numbers, all or none.

    Raises UsageError for an input or output that cannot be, another ending than SUFFIXES included, InputError where the
    board is not found or determines no camera, OutputError as `atomic_path` does.
    """
    outputs = (request.output, *beside(request.output))
    for output in outputs:
        refuse_input_as_output([request.path, *request.read], output)
    if request.output.suffix.lower() not in SUFFIXES:
        hint = f"end its name in {' or '.join(SUFFIXES)}"
        raise UsageError("is no name of a camera's YAML", file=request.output, hint=hint)
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
        camera.write_text(_heading(calibration) + camera_yaml(calibration.camera), encoding="utf-8")
        picture.write_bytes(draw_report(calibration, request.path.name))
        numbers.write_text(_json(request, search, calibration), encoding="utf-8")
        sound = source.report.complete and not search.other_sizes and calibration.verdict != "poor"
        said = (*source.info.notes, *source.report.notes, *notes)
    files = (outputs[0], outputs[1], outputs[2])
    return CalibrateOutcome(
        calibration,
        files,
        search.frames,
        search.looked_at,
        len(search.found),
        search.alike,
        tuple(dict.fromkeys(said)),
        0 if sound else 3,
    )


def _heading(calibration: Calibration) -> str:
    """Return comment lines for the camera's file: whoever finds it later sees what it is worth."""
    rms = calibration.solution.rms_px
    said = [f"landtool calibrate: {calibration.verdict}, rms {rms:.3f} px, {len(calibration.views)} views"]
    return "".join(f"# {line}\n" for line in (*said, *calibration.warnings))


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
            reason = frame.reason if isinstance(frame, LostFrame) else frame.damage
            search.lost.append(Refused(frame.index, frame.file, reason))
            continue
        size = frame.image.shape[1], frame.image.shape[0]
        if search.size == (0, 0):
            search.size = size
        if size != search.size:
            search.other_sizes.append(Refused(frame.index, frame.file, "{}x{}".format(*size)))
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
        count = f"{len(search.found)} of {pictures(search.looked_at)}" if search.found else "none of its pictures"
        hint = seen or "nor is another board seen; film the whole board, sharp, flat and well lit"
        reason = f"{board.article} {board.kind} of {board.size} is found in {count}, {LEAST_VIEWS} are needed"
        raise InputError(reason, hint=hint)
    calibration = calibrate_views(board, search.found, search.size, MODELS[request.model])
    differs = [*what_differs(board, search.with_board[:3], search.without), *better_model(calibration)]
    if differs:
        verdict: Verdict = "usable" if calibration.verdict == "good" else "poor"
        calibration = replace(calibration, warnings=(*differs, *calibration.warnings), verdict=verdict)
    return calibration, _left_out(search)


def _left_out(search: _Search) -> list[str]:
    """Say how many pictures took no part whatever they show, and which."""
    notes = []
    if search.lost:
        first = search.lost[0]
        notes.append(
            f"{pictures(len(search.lost))} lost or damaged and left out: {_named(search.lost)}; {first.reason}"
        )
    if search.other_sizes:
        count, (width, height) = len(search.other_sizes), search.size
        differ = f"{pictures(count)} {'is' if count == 1 else 'are'} not {width}x{height} as the first one"
        notes.append(f"{differ} and left out: {_named(search.other_sizes)}")
    return notes


def _named(left_out: list[Refused]) -> str:
    """Name the first few pictures."""
    names = [item.file or f"frame {item.frame}" for item in left_out]
    more = [f"{len(names) - _NAMED} more"] if len(names) > _NAMED else []
    return ", ".join([*names[:_NAMED], *more])


def _json(request: CalibrateRequest, search: _Search, calibration: Calibration) -> str:
    values = {
        "input": str(request.path),
        "frames": search.frames,
        "looked_at": search.looked_at,
        "alike": search.alike,
        "found": len(search.found),
        "not_found": dict(sorted(search.reasons.items())),
        "left_out": [
            {"frame": item.frame, "file": item.file, "reason": item.reason}
            for item in sorted((*search.lost, *search.other_sizes), key=lambda item: item.frame)
        ],
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
