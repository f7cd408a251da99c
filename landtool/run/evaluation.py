"""An evaluation: a dataset through every stage, its errors against truth, and what is kept of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from landtool.config import EvalConfig, TrackConfig
from landtool.detect.detector import Detector
from landtool.errors import LandtoolError, UsageError
from landtool.evaluate.baseline import Baseline, read_baseline, settings_digest, write_baseline
from landtool.evaluate.dataset import Clip, EvalDataset, FogPairs, Part, Stills, open_dataset
from landtool.evaluate.dehazing import ScoredPair
from landtool.evaluate.gate import GateResult, gate
from landtool.evaluate.junit import PartOutcome, write_junit
from landtool.evaluate.record import EvalRecord, ModelRecord, PartRecord, write_record
from landtool.evaluate.tolerance import read_tolerance
from landtool.io.atomic import atomic_folder, refuse_input_as_output
from landtool.io.run_record import HashedFile
from landtool.io.source import open_source
from landtool.io.tables import write_table
from landtool.pad import PadSpec
from landtool.run.detection import load_detector
from landtool.run.looking import judged
from landtool.run.scores import ERROR_TABLES, Scores
from landtool.run.scoring_clips import SeenClip, see_clip
from landtool.run.scoring_haze import see_pairs
from landtool.run.scoring_stills import SeenStills, see_stills

SHIPPED = "shipped"  # what the network in the package is called beside others
MARK = "metrics.json"
RUNS = "runs"
FAILED, LOSS = 1, 3  # the gate is not met; a part could not be scored, or there was none
NOTHING = "nothing to evaluate with was found: every number is undefined, 0 of 0"


@dataclass(frozen=True)
class EvalRequest:
    """What is to be evaluated. models: ONNX files, none for the shipped network. junit: where to write that, too."""

    evaluation: EvalConfig
    config: TrackConfig
    folder: Path
    models: tuple[Path, ...] = ()
    update_baseline: bool = False
    junit: Path | None = None
    overwrite: bool = False


@dataclass(frozen=True)
class EvalOutcome:
    """What became of it. gate: None without a baseline to compare with."""

    folder: Path
    record: EvalRecord
    gate: GateResult | None


@dataclass(frozen=True, eq=False)
class _Model:
    """A network to be judged: its name among the others, what it is set to, the loaded network and its file."""

    name: str
    config: TrackConfig
    detector: Detector
    file: Path


@dataclass
class _Progress:
    """Tells how far it is, and remembers which parts could not be scored, and what each took."""

    on_picture: Callable[[], None]
    outcomes: dict[str, PartOutcome] = field(default_factory=dict)
    errors: list[LandtoolError] = field(default_factory=list)

    @contextmanager
    def attempt(self, part: Part) -> Iterator[None]:
        """Go on after an error: a part that cannot be scored costs the others nothing."""
        began, failure = time.perf_counter(), ""
        try:
            yield
        except LandtoolError as error:
            self.errors.append(error)
            failure = f"{part.name} was not scored: {error}"
        before = self.outcomes.get(part.name, PartOutcome(part.name))
        seconds = before.seconds + time.perf_counter() - began
        self.outcomes[part.name] = PartOutcome(part.name, seconds, before.failure or failure)

    @property
    def failures(self) -> list[str]:
        """Why parts could not be scored, a sentence each."""
        return [outcome.failure for outcome in self.outcomes.values() if outcome.failure]


def evaluate(
    request: EvalRequest,
    *,
    on_expect: Callable[[int | None], None] = lambda _pictures: None,
    on_picture: Callable[[], None] = lambda: None,
) -> EvalOutcome:
    """Score every stage on every part of a dataset, and write what came out into a folder, whole or not at all.

    A part that cannot be scored costs the others nothing: its reason is in the notes, and the exit code is 3; it is 1
    when the gate is not met. Raises UsageError, InputError and OutputError as the parts do, the first part's own when
    none could be scored, and UsageError for several models with a baseline, which is about one.
    """
    evaluation = request.evaluation
    if evaluation.dataset is None:
        raise UsageError("no dataset to evaluate with", hint="give it with --dataset DIR")
    dataset = open_dataset(evaluation.dataset, evaluation.split)
    refuse_input_as_output([dataset.path, *request.models], request.folder)
    baseline = _baseline(request)
    models = _models(request)
    progress = _Progress(on_picture)
    counts = [PartRecord(part.name, _kind(part), _pictures(part)) for part in dataset.parts]
    on_expect(sum(part.frames for part in counts) * len(models))
    with atomic_folder(request.folder, overwrite=request.overwrite, mark=MARK) as temporary:
        scores = _scored(dataset, models, request, temporary / RUNS, progress)
        if progress.errors and len(progress.failures) == len(dataset.parts):
            raise progress.errors[0]
        metrics = [metric for scored in scores for metric in scored.metrics()]
        notes = [*dataset.notes, *progress.failures, *(note for scored in scores for note in scored.notes())]
        notes += [] if dataset.parts else [f"{dataset.path}: {NOTHING}"]
        now = Baseline(dataset.digest, _settings(request), tuple(metrics)) if evaluation.baseline else None
        result = None
        if baseline is not None and now is not None:
            same = baseline.dataset == now.dataset
            result = gate(baseline, metrics, read_tolerance(evaluation.tolerance), same_data=same)
            notes += [*baseline.notes(now), *result.notes]
        code = LOSS if progress.failures or not dataset.parts else 0
        record = EvalRecord(
            dataset=str(dataset.path),
            digest=dataset.digest,
            parts=tuple(counts),
            config={"eval": asdict(evaluation), "track": asdict(request.config)},
            models=tuple(ModelRecord(model.name, HashedFile.of(model.file)) for model in models),
            metrics=tuple(metrics),
            curves=tuple(scored.curve() for scored in scores if "detection" in evaluation.stages),
            speed=tuple(spent for scored in scores for spent in scored.speed),
            notes=tuple(dict.fromkeys(notes)),
            gate=None if result is None else result.as_values(str(evaluation.baseline)),
            exit_code=FAILED if result is not None and not result.passed else code,
        )
        write_record(temporary, record, tables="csv" in evaluation.save)
        if "csv" in evaluation.save:
            _write_errors(temporary, scores, evaluation.stages)
    if request.update_baseline and now is not None and evaluation.baseline is not None:
        write_baseline(evaluation.baseline, now)
    if request.junit is not None:
        write_junit(request.junit, list(progress.outcomes.values()), result, overwrite=True)
    return EvalOutcome(request.folder, record, result)


def _baseline(request: EvalRequest) -> Baseline | None:
    """Return what is to be compared with, None where nothing is; wrong files are told before the work begins."""
    path = request.evaluation.baseline
    if path is not None and len(request.models) > 1:
        raise UsageError("a baseline is about one network", hint="give --model once, or leave out --baseline")
    read_tolerance(request.evaluation.tolerance)
    return None if path is None or request.update_baseline else read_baseline(path)


def _models(request: EvalRequest) -> list[_Model]:
    """Load the networks. Those of one file name are told apart by their folders."""
    files: Sequence[Path | None] = request.models or (request.config.detector.model,)
    stems = [SHIPPED if file is None else file.stem for file in files]
    names = [
        stem if file is None or stems.count(stem) == 1 else "-".join((file.absolute().parent.name, stem))
        for stem, file in zip(stems, files, strict=True)
    ]
    if len(set(names)) < len(names):
        raise UsageError("two models of one name", hint="give each once, from folders of different names")
    models = []
    for name, file in zip(names, files, strict=True):
        config = replace(request.config, detector=replace(request.config.detector, model=file))
        models.append(_Model(name, config, *load_detector(judged(config.detector))))
    return models


def _scored(
    dataset: EvalDataset, models: Sequence[_Model], request: EvalRequest, runs: Path, progress: _Progress
) -> list[Scores]:
    """Show every part to every network; what has no network in it, as dehazing by itself, is done once."""
    pairs: list[ScoredPair] = []
    for part in dataset.fog_pairs if "dehaze" in request.evaluation.stages else ():
        with progress.attempt(part):
            pairs += see_pairs(part, request.config.dehazer, progress.on_picture)
    folders = [runs] if len(models) == 1 else [runs / model.name for model in models]
    return [
        _of_model(dataset, model, request.evaluation, folder, pairs, progress)
        for model, folder in zip(models, folders, strict=True)
    ]


def _of_model(
    dataset: EvalDataset,
    model: _Model,
    evaluation: EvalConfig,
    runs: Path,
    pairs: Sequence[ScoredPair],
    progress: _Progress,
) -> Scores:
    # every data set counts its classes from 0: together they have one list
    names = tuple(dict.fromkeys(name for part in dataset.stills for name in part.names)) or ("pad",)
    stills: list[tuple[SeenStills, PadSpec]] = []
    clips: list[SeenClip] = []
    for part in dataset.stills:
        with progress.attempt(part):
            pad = _pad_of(part, model.config)
            named = _renumbered(part, names)
            seen = see_stills(
                named, model.detector, model.config, pad, stages=evaluation.stages, on_picture=progress.on_picture
            )
            stills.append((seen, pad))
    for clip in dataset.clips:
        with progress.attempt(clip):
            clips.append(see_clip(clip, model.detector, model.config, evaluation, runs, on_picture=progress.on_picture))
    classes = model.detector.names
    return Scores(model.name, classes, names, model.config, evaluation, tuple(stills), tuple(clips), tuple(pairs))


def _renumbered(part: Stills, names: Sequence[str]) -> Stills:
    """Return labelled pictures whose classes are numbered by the names of all data sets."""
    number = [names.index(name) for name in part.names]
    if number == list(range(len(number))):
        return part
    images = tuple(
        replace(image, boxes=tuple(replace(box, class_id=number[box.class_id]) for box in image.boxes))
        for image in part.images
    )
    return replace(part, images=images)


def _pad_of(part: Stills, config: TrackConfig) -> PadSpec:
    """Return the pad in labelled pictures: the one beside them, else the settings', else pad v1."""
    file = part.pad or config.pad
    return PadSpec() if file is None else PadSpec.read(file)


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
