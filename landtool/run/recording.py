"""One recording through a pipeline into its folder: what every command that reads recordings has in common."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from landtool.camera import Camera
from landtool.config import DetectConfig, TrackConfig
from landtool.draw import Overlay
from landtool.geometry import Pose
from landtool.io.atomic import atomic_folder, refuse_input_as_output
from landtool.io.prefetch import prefetch
from landtool.io.run_record import Counts, HashedFile, RunRecord, StageTime, provenance, write_run
from landtool.io.source import Source, SourceInfo, open_source
from landtool.io.tables import TABLES
from landtool.pad import PadSpec
from landtool.sink import CameraFromReference, SinkSetup
from landtool.sinks import open_sinks, write_all
from landtool.types import Frame, FrameResult, LostFrame

_AHEAD = 4  # frames decoded, and results measured, ahead of their use: enough to even out their times
Results = Iterator[tuple[Frame | LostFrame, FrameResult]]
OnFrame = Callable[[Frame | LostFrame, FrameResult], None]


class RunSummary(Protocol):
    """Watches results go by and tells at the end what they were."""

    @property
    def frames(self) -> int:
        """Frames so far, lost ones counted."""
        ...

    @property
    def lossy(self) -> bool:
        """Whether pictures were left out."""
        ...

    def watch(self, results: Results) -> Results:
        """Pass results on and take them in."""
        ...

    def lines(self) -> list[str]:
        """Return the summary as text, a fact a line."""
        ...

    def facts(self, wall_s: float) -> Mapping[str, Any] | None:
        """Return the verdict on a landing as plain values, None where none is judged; wall_s: what the run took."""
        ...

    def notes(self) -> list[str]:
        """Return what makes the results less than they seem, one sentence each."""
        ...


@dataclass(frozen=True)
class RunRequest:
    """One recording, its folder, and how it is to be run.

    read: the other files the settings name. model: the network's file, where one is used.
    """

    command: str
    path: Path
    folder: Path
    config: TrackConfig | DetectConfig
    read: tuple[Path, ...] = ()
    model: Path | None = None
    overwrite: bool = False
    on_start: Callable[[SourceInfo], None] | None = None
    on_frame: OnFrame | None = None


@dataclass(frozen=True)
class RunParts:
    """What a run is put together from, once its source is known. measure: from frames to results.

    camera, pad, body_T_camera: for the outputs that tell of them, None where there are none. nis_dof: numbers a
    measurement of the filter has, 2 or 4. finish: what is left to do in the folder when all frames are written.
    """

    measure: Callable[[Iterable[Frame | LostFrame]], Results]
    summary: RunSummary
    overlay: Overlay = field(default_factory=Overlay)
    tables: tuple[str, ...] = tuple(TABLES)
    camera_T_reference: CameraFromReference = lambda _result: None
    camera: Camera | None = None
    pad: PadSpec | None = None
    body_T_camera: Pose | None = None
    nis_dof: int = 2
    finish: Callable[[Path], None] = lambda _folder: None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class RunOutcome:
    """What became of one input.

    exit_code: 0, or 3 when frames were lost or damaged. camera: of the pictures as they were measured, if there is one.
    """

    folder: Path
    summary: RunSummary
    counts: Counts
    timings: dict[str, StageTime]
    notes: tuple[str, ...]
    wall_s: float
    exit_code: int
    camera: Camera | None = None


def run_recording(request: RunRequest, prepare: Callable[[SourceInfo], RunParts]) -> RunOutcome:
    """Run one recording and write what was found into its folder, whole or not at all.

    prepare: makes the parts; what it raises leaves nothing behind. Raises UsageError, InputError and OutputError as
    the parts do.
    """
    started = time.perf_counter()
    config = request.config
    refuse_input_as_output([request.path, *request.read], request.folder)
    hashed = cache(lambda: tuple(HashedFile.of(file) for file in (request.path, *request.read)))
    with ExitStack() as stack:
        source = stack.enter_context(open_source(request.path, topic=config.topic, fps=config.fps))
        parts = prepare(source.info)
        temporary = stack.enter_context(atomic_folder(request.folder, overwrite=request.overwrite))
        if request.on_start is not None:
            request.on_start(source.info)
        setup = SinkSetup(
            temporary,
            tables=parts.tables,
            overlay=parts.overlay,
            has_clock=source.info.has_clock,
            time_base=source.info.time_base,
            camera_T_reference=parts.camera_T_reference,
            camera=parts.camera,
            pad=parts.pad,
            body_T_camera=parts.body_T_camera,
            provenance=lambda: provenance(request.command, asdict(config), hashed()),
            recording=request.path,
            nis_dof=parts.nis_dof,
        )
        frames = stack.enter_context(closing(prefetch(iter(source), _AHEAD)))
        ahead = stack.enter_context(closing(prefetch(parts.measure(frames), _AHEAD)))
        with open_sinks(config.save, setup) as sinks:
            written = write_all(parts.summary.watch(ahead), sinks, request.on_frame)
        parts.finish(temporary)
        said = (*parts.notes, *source.info.notes, *source.report.notes, *(n for s in sinks for n in s.notes))
        outcome = RunOutcome(
            request.folder,
            parts.summary,
            _counts(source, written.pictures),
            written.timings,
            tuple(dict.fromkeys((*said, *parts.summary.notes()))),
            time.perf_counter() - started,
            0 if source.report.complete and not parts.summary.lossy else 3,
            parts.camera,
        )
        write_run(temporary, _record(request, outcome, hashed()))
    return outcome


def _counts(source: Source, written: int) -> Counts:
    report = source.report
    return Counts(report.declared, report.decoded, report.damaged, report.lost, report.skipped, written)


def _record(request: RunRequest, outcome: RunOutcome, inputs: tuple[HashedFile, ...]) -> RunRecord:
    return RunRecord(
        command=request.command,
        config=asdict(request.config),
        inputs=inputs,
        counts=outcome.counts,
        exit_code=outcome.exit_code,
        model=None if request.model is None else HashedFile.of(request.model),
        timings=outcome.timings,
        notes=outcome.notes,
        verdict=outcome.summary.facts(outcome.wall_s),
    )
