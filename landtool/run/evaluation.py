"""An evaluation: a dataset through every stage, its errors against truth, and what is kept of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from landtool.config import EvalConfig, TrackConfig
from landtool.errors import LandtoolError, UsageError
from landtool.evaluate.baseline import Baseline, read_baseline, settings_digest, write_baseline
from landtool.evaluate.dataset import Clip, EvalDataset, FogPairs, Part, Stills, open_dataset
from landtool.evaluate.gate import GateResult, gate
from landtool.evaluate.junit import write_junit
from landtool.evaluate.record import METRICS_JSON, EvalRecord, ModelRecord, PartRecord, write_record
from landtool.evaluate.tolerance import read_tolerance
from landtool.io.atomic import atomic_folder, refuse_input_as_output
from landtool.io.run_record import HashedFile
from landtool.io.source import open_source
from landtool.io.tables import write_table
from landtool.run.detection import load_detector
from landtool.run.eval_request import EvalRequest, files_of, refuse_impossible
from landtool.run.looking import judged
from landtool.run.scores import ERROR_TABLES, Scores
from landtool.run.scoring import Judged, Progress, looks, scored

SHIPPED = "shipped"  # what the network in the package is called beside others
RUNS = "runs"
FAILED, LOSS = 1, 3  # the gate is not met; a part could not be scored, or there was none
NOTHING = "nothing to evaluate with was found: every number is undefined, 0 of 0"
NOT_KEPT = "not written, as not all of the data could be scored"


@dataclass(frozen=True)
class EvalOutcome:
    """What became of it. gate: None without a baseline to compare with. kept: whether the baseline was written."""

    folder: Path
    record: EvalRecord
    gate: GateResult | None
    kept: bool = False


def evaluate(
    request: EvalRequest,
    *,
    on_expect: Callable[[int | None], None] = lambda _pictures: None,
    on_picture: Callable[[], None] = lambda: None,
) -> EvalOutcome:
    """Score every stage on every part of a dataset, and write what came out into a folder, whole or not at all.

    A part that cannot be scored costs the others nothing: its reason is in the notes, and the exit code is 3, as after
    a recording that could not be decoded whole; it is 1 when the gate is not met. A baseline is kept of a run in which
    all parts were scored. Raises UsageError, InputError and OutputError as `refuse_impossible` and the parts do, the
    first part's own when none could be scored.
    """
    evaluation = request.evaluation
    if evaluation.dataset is None:
        raise UsageError("no dataset to evaluate with", hint="give it with --dataset DIR")
    refuse_impossible(request)
    dataset = open_dataset(evaluation.dataset, evaluation.split)
    refuse_input_as_output([dataset.path, *files_of(request)], request.folder)
    baseline = None if request.update_baseline or evaluation.baseline is None else read_baseline(evaluation.baseline)
    models = _models(request)
    progress = Progress(on_picture)
    counts = [PartRecord(part.name, _kind(part), _pictures(part)) for part in dataset.parts]
    frames = zip(dataset.parts, counts, strict=True)
    on_expect(sum(looks(part, count.frames, evaluation, len(models)) for part, count in frames))
    with atomic_folder(request.folder, overwrite=request.overwrite, mark=METRICS_JSON) as temporary:
        scores = scored(dataset, models, evaluation, request.config.dehazer, temporary / RUNS, progress)
        if progress.in_vain:
            _write_junit(request, progress, None)
            raise progress.errors[0]
        metrics = tuple(m for made in scores for m in made.metrics())
        # of one network: several have their numbers under the same names
        now = None if evaluation.baseline is None else Baseline(dataset.digest, _settings(request), metrics)
        result = None if baseline is None or now is None else _compared(baseline, now, evaluation)
        is_kept = request.update_baseline and bool(progress.outcomes) and not progress.failures
        notes = [*dataset.notes, *progress.failures, *(note for made in scores for note in made.notes())]
        notes += [*_idle(dataset, request.config), *([] if progress.outcomes else [f"{dataset.path}: {NOTHING}"])]
        notes += [] if baseline is None or now is None or result is None else [*baseline.notes(now), *result.notes]
        notes += [f"{evaluation.baseline}: {NOT_KEPT}"] if request.update_baseline and not is_kept else []
        record = EvalRecord(
            dataset=str(dataset.path),
            digest=dataset.digest,
            parts=tuple(counts),
            config={"eval": asdict(evaluation), "track": asdict(request.config)},
            models=tuple(ModelRecord(model.name, HashedFile.of(model.file)) for model in models),
            metrics=metrics,
            curves=tuple(made.curve() for made in scores if "detection" in evaluation.stages),
            speed=tuple(spent for made in scores for spent in made.speed),
            notes=tuple(dict.fromkeys(notes)),
            gate=None if result is None else result.as_values(str(evaluation.baseline)),
            exit_code=_exit_code(result, progress, scores),
        )
        write_record(temporary, record, tables="csv" in evaluation.save)
        if "csv" in evaluation.save:
            _write_errors(temporary, scores, evaluation.stages)
    if is_kept and now is not None and evaluation.baseline is not None:
        write_baseline(evaluation.baseline, now)
    _write_junit(request, progress, result)
    return EvalOutcome(request.folder, record, result, is_kept)


def _exit_code(result: GateResult | None, progress: Progress, scores: Sequence[Scores]) -> int:
    if result is not None and not result.passed:
        return FAILED
    is_lossy = progress.failures or not progress.outcomes or any(made.lossy for made in scores)
    return LOSS if is_lossy else 0


def _compared(baseline: Baseline, now: Baseline, evaluation: EvalConfig) -> GateResult:
    tolerance = read_tolerance(evaluation.tolerance)
    return gate(baseline, now.metrics, tolerance, same_data=baseline.dataset == now.dataset)


def _write_junit(request: EvalRequest, progress: Progress, result: GateResult | None) -> None:
    if request.junit is not None:
        write_junit(request.junit, progress.outcomes, result, overwrite=True)


def _idle(dataset: EvalDataset, config: TrackConfig) -> Iterator[str]:
    """Yield what was given and is not used, as what lies beside the parts wins over it."""
    clips = dataset.clips
    pads = [clip.pad for clip in clips] + [part.pad for part in dataset.stills]
    if (config.camera is not None or config.hfov_deg is not None) and clips and all(clip.camera for clip in clips):
        yield "the camera given was not used: every recording has a calibration beside it"
    if (config.pad is not None or config.diameter_m is not None) and pads and all(pads):
        yield "the pad given was not used: all the data have their own beside them"


def _models(request: EvalRequest) -> list[Judged]:
    """Load the networks. Those of one file name are told apart by their folders."""
    files: Sequence[Path | None] = request.models or (request.config.detector.model,)
    stems = [SHIPPED if file is None else file.stem for file in files]
    names = [
        stem if file is None or stems.count(stem) == 1 else "-".join((file.parent.resolve().name, stem))
        for stem, file in zip(stems, files, strict=True)
    ]
    if len(set(names)) < len(names):
        raise UsageError("two models of one name", hint="give each once, from folders of different names")
    models = []
    for name, file in zip(names, files, strict=True):
        config = replace(request.config, detector=replace(request.config.detector, model=file))
        models.append(Judged(name, config, *load_detector(judged(config.detector))))
    return models


def _kind(part: Part) -> str:
    return {Stills: "stills", Clip: "clip", FogPairs: "pairs"}[type(part)]


def _pictures(part: Part) -> int:
    """Return how many pictures a part has; of a recording, how many its container says."""
    if isinstance(part, Stills):
        return len(part.images)
    if isinstance(part, FogPairs):
        return len(part.pairs)
    try:
        with open_source(part.path) as source:
            return source.info.frames_declared or 0
    except LandtoolError:  # said when it is scored
        return 0


def _settings(request: EvalRequest) -> str:
    """Return a digest of what the numbers depend on, wherever its files lie."""
    values = {"track": asdict(request.config), "eval": asdict(request.evaluation)}
    for name in ("dataset", "baseline", "tolerance", "save"):
        del values["eval"][name]
    for name in ("camera", "pad", "mount", "ego", "save"):
        del values["track"][name]
    return settings_digest(values)


def _write_errors(folder: Path, scores: Sequence[Scores], stages: Sequence[str]) -> None:
    """Write the tables of errors; what no network takes part in is the same for all and written once."""
    for name, (stage, table) in ERROR_TABLES.items():
        if stage in stages:
            rows = dict.fromkeys(row for scored in scores for row in table.rows(scored))
            write_table(folder / name, table.columns, rows)
