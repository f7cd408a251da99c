"""One recording without its haze: of the same kind, size and timing."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing
from pathlib import Path

from landtool.config import DehazeCommandConfig
from landtool.dehaze.stage import Dehazed, DehazeStage
from landtool.io.atomic import refuse_input_as_output
from landtool.io.prefetch import prefetch
from landtool.io.run_record import Counts, StageTime
from landtool.io.source import Source, SourceInfo, open_source
from landtool.run.dehazed_files import map_folder, refuse_other_kind
from landtool.run.dehazed_outputs import OUTPUTS, MapsOutput, Output, OutputSetup
from landtool.run.recording import OnFrame, Results, RunOutcome
from landtool.types import Frame, FrameResult, LostFrame

_AHEAD = 4  # frames decoded, and frames dehazed, ahead of their use: enough to even out their times
_NAMED = 5  # unreadable pictures that are named
Seen = Iterator[tuple[Frame | LostFrame, Dehazed | None, float]]


class DehazeSummary:
    """Counts over a run; memory does not grow with its length. maps: the folder of the transmissions, if written."""

    lossy = False  # every picture that was decoded is written

    def __init__(self, maps: Path | None = None) -> None:
        self.frames = self.dehazed = 0
        self._maps = maps
        self._unread: list[str] = []
        self._hazes: Counter[float] = Counter()  # by thousandths

    def watch(self, results: Results) -> Results:
        """Pass results on and take them in."""
        for frame, result in results:
            self.frames += 1
            self.dehazed += result.dehazed
            if isinstance(frame, LostFrame) and frame.file and len(self._unread) <= _NAMED:
                self._unread.append(frame.file)
            if result.haze is not None:
                self._hazes[round(result.haze, 3)] += 1
            yield frame, result

    def lines(self) -> list[str]:
        """Return the summary as text, a fact a line."""
        share = 100 * self.dehazed / max(1, self.frames)
        lines = [f"frames {self.frames}, dehazed {self.dehazed} ({share:.1f}%)"]
        if self._hazes:
            low, high = min(self._hazes), max(self._hazes)
            lines.append(f"haze {self._median():.2f} in the median, {low:.2f} to {high:.2f}")
        if self._maps is not None:
            lines.append(f"transmission maps in {self._maps}" if self.dehazed else "no transmission maps")
        return lines

    def facts(self, wall_s: float) -> None:
        """Return nothing: a dehazed picture is no landing to judge."""

    def notes(self) -> list[str]:
        """Return which pictures of a folder could not be read."""
        if not self._unread:
            return []
        more = " and others" if len(self._unread) > _NAMED else ""
        return [f"not read: {', '.join(self._unread[:_NAMED])}{more}"]

    def _median(self) -> float:
        """Return the lower median."""
        passed, half = 0, self._hazes.total() / 2
        for haze in sorted(self._hazes):
            passed += self._hazes[haze]
            if passed >= half:
                return haze
        return 0.0


def dehaze(
    path: Path,
    output: Path,
    config: DehazeCommandConfig,
    *,
    overwrite: bool = False,
    on_start: Callable[[SourceInfo], None] | None = None,
    on_frame: OnFrame | None = None,
) -> RunOutcome:
    """Dehaze one recording and write it to `output`, a file or folder of the same kind, whole or not at all.

    Raises UsageError, InputError and OutputError as the parts do, UsageError for an output of another kind.
    """
    started = time.perf_counter()
    maps = map_folder(path, output) if config.save_transmission else None
    refuse_other_kind(path, output)
    for target in (output, maps) if maps else (output,):
        refuse_input_as_output([path], target)
    summary, timings = DehazeSummary(maps), {"dehaze": StageTime(), "write": StageTime()}
    with ExitStack() as stack:
        source = stack.enter_context(open_source(path, topic=config.topic, fps=config.fps))
        stage = DehazeStage(config.dehazer, when=config.when)
        outputs = [stack.enter_context(made) for made in _outputs(source, output, maps, config, overwrite)]
        if on_start is not None:
            on_start(source.info)
        frames = stack.enter_context(closing(prefetch(iter(source), _AHEAD)))
        ahead = stack.enter_context(closing(prefetch(_seen(frames, stage), _AHEAD)))
        for frame, result in summary.watch(_written(ahead, outputs, timings)):
            if on_frame is not None:
                on_frame(frame, result)
    wall_s = time.perf_counter() - started
    return _outcome(output, source, summary, outputs, timings, wall_s)


def _outputs(
    source: Source, output: Path, maps: Path | None, config: DehazeCommandConfig, overwrite: bool
) -> list[Output]:
    info = source.info
    is_folder = info.path.is_dir()
    names = frozenset(entry.name for entry in info.path.iterdir()) if is_folder else frozenset({info.path.name})
    made = [OUTPUTS[info.kind](OutputSetup(info, output, overwrite, config.side_by_side, names))]
    if maps is not None:
        made.append(MapsOutput(OutputSetup(info, maps, overwrite, names=names)))
    return made


def _seen(frames: Iterable[Frame | LostFrame], stage: DehazeStage) -> Seen:
    """Give each frame, what the stage makes of it, and the seconds that took."""
    for frame in frames:
        start = time.perf_counter()
        seen = stage.see(frame) if isinstance(frame, Frame) else None
        if seen is not None:
            _ = seen.image  # made here, ahead of the outputs
        yield frame, seen, time.perf_counter() - start


def _written(ahead: Seen, outputs: Sequence[Output], timings: dict[str, StageTime]) -> Results:
    """Pass every frame to the outputs, and give what is known of it."""
    for frame, seen, seconds in ahead:
        start = time.perf_counter()
        for output in outputs:
            output.write(frame, seen)
        spent = {"dehaze": seconds, "write": time.perf_counter() - start}
        for name, value in spent.items():
            timings[name] = timings[name].add(value)
        yield frame, _result(frame, seen, spent)


def _result(frame: Frame | LostFrame, seen: Dehazed | None, spent: dict[str, float]) -> FrameResult:
    if isinstance(frame, LostFrame) or seen is None:
        reason = frame.reason if isinstance(frame, LostFrame) else ""
        return FrameResult(frame.index, frame.t_ns, frame.file, "damaged", reason, stage_seconds=spent)
    return FrameResult(
        frame.index,
        frame.t_ns,
        frame.file,
        frame.status,
        frame.damage,
        haze=seen.haze,
        dehazed=seen.dehazed,
        stage_seconds=spent,
    )


def _outcome(
    output: Path,
    source: Source,
    summary: DehazeSummary,
    outputs: Sequence[Output],
    timings: dict[str, StageTime],
    wall_s: float,
) -> RunOutcome:
    report = source.report
    counts = Counts(report.declared, report.decoded, report.damaged, report.lost, report.skipped, report.decoded)
    notes = dict.fromkeys(
        [*source.info.notes, *report.notes, *(note for made in outputs for note in made.notes), *summary.notes()]
    )
    whole = report.complete and not any(made.lossy for made in outputs)
    return RunOutcome(output, summary, counts, timings, tuple(notes), wall_s, 0 if whole else 3)
