"""A training from its data to its weights, in a folder that can be watched and gone on with."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import torch

from landtool.darknet.cfg import read_cfg
from landtool.darknet.checkpoint import SUFFIX, read_checkpoint
from landtool.darknet.edit import edited
from landtool.darknet.network import Network
from landtool.darknet.weights import read_weights, write_weights
from landtool.errors import InputError, LandtoolError, UsageError
from landtool.io.run_record import Counts, RunRecord, StageTime, write_run
from landtool.memory import keep_memory
from landtool.train.anchors import kmeans_anchors
from landtool.train.batches import BatchMaker
from landtool.train.charts import draw_curves, validation_sheet
from landtool.train.checkpoint import Progress, load_state, save_state, save_weights
from landtool.train.data import TrainingData, open_data
from landtool.train.results import ResultRow, parse_results, results_csv
from landtool.train.run_folder import RunFolder, open_run
from landtool.train.settings import TrainSettings
from landtool.train.step import Learner, StepLoss, bf16_gains, learning_rate, uses_bf16
from landtool.train.validate import Validation

TABLE_I = Path(__file__).resolve().parent.parent / "data" / "pad-tiny-yolov3.cfg"
Tell = Callable[[str], None]


class TrainingError(LandtoolError):
    """A training that cannot go on."""


@dataclass(frozen=True)
class Step:
    """One step taken: how many there are now, of how many, its loss, and what the last validation said."""

    iteration: int
    iterations: int
    loss: StepLoss
    map50: float | None


@dataclass(frozen=True)
class TrainOutcome:
    """What became of a training. rows: its results, the best of which is kept. best, last: checkpoints."""

    folder: Path
    rows: tuple[ResultRow, ...]
    best: Path
    last: Path
    seconds: float

    @property
    def best_row(self) -> ResultRow:
        """The results of the network that was kept."""
        return max(self.rows, key=_worth)


def train(
    data: str,
    folder: Path,
    settings: TrainSettings,
    *,
    overwrite: bool = False,
    tell: Tell = lambda _text: None,
    on_step: Callable[[Step], None] = lambda _step: None,
) -> TrainOutcome:
    """Train a network and write it, its results and pictures of them into `folder`.

    data: a data.yaml, a darknet .data file, or `generate:SEED`. A training that was interrupted goes on where its last
    checkpoint was written, and ends with the same weights as if it had not been. tell: is told what is going on.
    Raises UsageError, InputError, OutputError as the parts do, TrainingError when the loss is no number any more.
    """
    keep_memory(even_largest=True)  # a third faster
    torch.set_num_threads(settings.threads or torch.get_num_threads())
    with open_data(data, settings) as opened:
        network = prepared(settings, opened, tell)
        request = {**opened.identity, "settings": asdict(replace(settings, threads=None)), "cfg": network.text}
        run = open_run(folder, request, overwrite=overwrite)
        run.write(run.network.name, network.text.encode())
        bf16 = _arithmetic(network, settings, tell)
        return _Training(run, opened, Learner(network, settings, bf16=bf16), bf16, tell, on_step).run()


def prepared(settings: TrainSettings, data: TrainingData, tell: Tell) -> Network:
    """Return the network to train: the cfg, at the size and with the anchors the settings ask for."""
    network = read_cfg(settings.cfg or TABLE_I)
    if network.classes != len(data.names):
        reason = f"the cfg is for {network.classes} classes, the data name {len(data.names)}"
        raise UsageError(reason, file=settings.cfg, hint="set classes= and filters= of the cfg to fit")
    if settings.size is not None:
        network = edited(network, width=settings.size[0], height=settings.size[1], letterbox=True)
    if settings.pyramid:
        network = edited(network, pyramid=True)
    if settings.anchors == "kmeans":
        count = sum(len(head.anchors) for _, head in network.heads)
        anchors, mean_iou = kmeans_anchors(_shown_sizes(network, data), count, np.random.default_rng(settings.seed))
        network = edited(network, anchors=anchors)
        tell(f"anchors by k-means: {' '.join(f'{w:g},{h:g}' for w, h in anchors)} (mean overlap {mean_iou:.3f})")
    return network


def _shown_sizes(network: Network, data: TrainingData) -> np.ndarray:
    scale = np.array([network.width, network.height]) / data.sizes_in_px
    return data.sizes_px * (scale.min(axis=1, keepdims=True) if network.letterbox else scale)


def _arithmetic(network: Network, settings: TrainSettings, tell: Tell) -> bool:
    if settings.bf16 != "auto":
        return settings.bf16 == "on"
    float32, bf16 = bf16_gains(network)
    chosen = uses_bf16(settings.bf16, float32, bf16)
    tell(f"float32 {float32:.0f} pictures/s, bf16 {bf16:.0f}: training in {'bf16' if chosen else 'float32'}")
    return chosen


class _Training:
    """The loop and what it keeps in mind."""

    def __init__(
        self,
        run: RunFolder,
        data: TrainingData,
        learner: Learner,
        bf16: bool,
        tell: Tell,
        on_step: Callable[[Step], None],
    ) -> None:
        self._run, self._data, self._learner, self._bf16 = run, data, learner, bf16
        self._tell, self._on_step = tell, on_step
        self._settings = learner.settings
        self._progress, self._rows = self._start()

    def run(self) -> TrainOutcome:
        """Take the steps that are left."""
        settings = self._settings
        maker = BatchMaker(self._data.samples, self._learner.network, settings)
        since, saved = time.monotonic(), time.monotonic()
        with closing(maker.ahead(self._progress.iteration, settings.iterations)) as batches:
            for batch in batches:
                loss = self._learner.learn(batch)
                self._refuse_nan(loss)
                now = time.monotonic()
                self._count(loss, now - since)
                since = now
                done = self._progress.iteration
                if done % settings.validate_every == 0 or done == settings.iterations:
                    self._validate()
                last = self._rows[-1].map50 if self._rows else None
                self._on_step(Step(done, settings.iterations, loss, last))
                if now - saved > 60.0 * settings.save_minutes or done == settings.iterations:
                    save_state(self._run.last, self._learner, self._data.names, self._progress)
                    saved = time.monotonic()
        return self._finish()

    def _start(self) -> tuple[Progress, list[ResultRow]]:
        if self._run.last.exists():
            progress = load_state(self._run.last, self._learner)
            rows = parse_results(self._run.results.read_text(encoding="utf-8")) if self._run.results.exists() else []
            self._tell(f"going on after iteration {progress.iteration}")
            return progress, [row for row in rows if row.iteration <= progress.iteration]
        if self._settings.weights is not None:
            _load_start(self._learner, self._settings.weights)
        return Progress(), []

    def _refuse_nan(self, loss: StepLoss) -> None:
        if math.isfinite(loss.total):
            return
        reason = f"the loss is no number any more at iteration {self._progress.iteration + 1}"
        hint = "begin anew with a lower --learning-rate; weights/ holds what was learnt before"
        raise TrainingError(reason, file=self._run.path, hint=hint)

    def _count(self, loss: StepLoss, seconds: float) -> None:
        p = self._progress
        box, objectness, classes = p.losses
        sums = (box + loss.box, objectness + loss.objectness, classes + loss.classes)
        self._progress = replace(
            p, iteration=p.iteration + 1, seconds=p.seconds + seconds, losses=sums, steps=p.steps + 1
        )

    def _validate(self) -> None:
        validation = self._data.validator.validate(self._learner.averaged, bf16=self._bf16)
        row = self._row(validation)
        self._rows.append(row)
        improved = _worth(row) > self._progress.best
        self._progress = replace(
            self._progress, losses=(0.0, 0.0, 0.0), steps=0, best=max(self._progress.best, _worth(row))
        )
        if improved:
            save_weights(self._run.best, self._learner, self._data.names, self._progress.iteration)
            sheet = validation_sheet(self._data.validator.pictures, self._data.validator.images, validation.found)
            self._run.write("validation.png", cv2.imencode(".png", sheet)[1].tobytes())
        self._run.write(self._run.results.name, results_csv(self._rows).encode())
        self._run.write("curves.png", draw_curves(self._rows))
        self._tell(
            f"iteration {row.iteration}: loss {row.loss_box + row.loss_objectness + row.loss_classes:.3f}, "
            f"mAP50 {_text(row.map50)}, mAP50-95 {_text(row.map50_95)}, recall {_text(row.recall)}, "
            f"{row.seconds / 60.0:.1f} min"
        )

    def _row(self, validation: Validation) -> ResultRow:
        p, score = self._progress, validation.score
        box, objectness, classes = (total / max(1, p.steps) for total in p.losses)
        rate = learning_rate(p.iteration - 1, self._settings, self._learner.network)
        return ResultRow(
            p.iteration,
            p.seconds,
            box,
            objectness,
            classes,
            rate,
            score.precision,
            score.recall,
            score.map50,
            score.map50_95,
        )

    def _finish(self) -> TrainOutcome:
        network, weights, _ = read_checkpoint(self._run.best)
        write_weights(self._run.best.with_suffix(".weights"), weights, network, overwrite=True)
        p = self._progress
        write_run(
            self._run.path,
            RunRecord(
                command="train",
                config=asdict(self._settings),
                inputs=(),
                counts=Counts(None, p.iteration * self._settings.batch, 0, 0, 0, 0),
                exit_code=0,
                seed=self._settings.seed,
                timings={"step": StageTime(p.seconds, p.iteration)},
                notes=(f"data: {self._data.identity['data']}",),
            ),
            overwrite=True,
        )
        return TrainOutcome(self._run.path, tuple(self._rows), self._run.best, self._run.last, p.seconds)


def _load_start(learner: Learner, path: Path) -> None:
    """Begin with the weights of a file: a checkpoint's, a darknet network's or those of its first layers."""
    if path.suffix == SUFFIX:
        network, weights, _ = read_checkpoint(path)
        if [c for _, c in network.convolutions] != [c for _, c in learner.network.convolutions]:
            raise InputError("is of another network", file=path, hint="give the cfg it was trained with, --cfg")
    else:
        weights = read_weights(path, learner.network, backbone=True)
    learner.model.load(weights)
    learner.averaged.load(weights)


def _worth(row: ResultRow) -> float:
    """What decides which network is kept: how tight its boxes are counts as much as how many it finds."""
    return (row.map50 or 0.0) + (row.map50_95 or 0.0)


def _text(value: float | None) -> str:
    return "undefined" if value is None else f"{value:.4f}"
