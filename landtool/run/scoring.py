"""Shows every part of a dataset to every network, and remembers what went wrong on the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from landtool.config import EvalConfig, TrackConfig
from landtool.dehaze.config import DehazeConfig
from landtool.detect.detector import Detector
from landtool.errors import LandtoolError
from landtool.evaluate.dataset import EvalDataset, FogPairs, Part, Stills
from landtool.evaluate.dehazing import ScoredPair
from landtool.evaluate.junit import PartOutcome
from landtool.pad import PadSpec
from landtool.run.scores import Scores
from landtool.run.scoring_clips import SeenClip, see_clip
from landtool.run.scoring_haze import see_pairs
from landtool.run.scoring_stills import SeenStills, see_stills
from landtool.run.tracking import pad_of

# What is looked at for which stages
OF_STILLS, OF_CLIPS, OF_PAIRS = {"detection", "pose", "dehaze"}, {"detection", "pose", "track"}, {"dehaze"}


@dataclass(frozen=True, eq=False)
class Judged:
    """A network to be judged: its name among the others, what it is set to, the loaded network and its file."""

    name: str
    config: TrackConfig
    detector: Detector
    file: Path


@dataclass
class Progress:
    """Tells how far it is, and remembers which parts could not be scored, and what each took."""

    on_picture: Callable[[], None]
    _outcomes: dict[tuple[type, str], PartOutcome] = field(default_factory=dict)
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
        before = self._outcomes.get((type(part), part.name), PartOutcome(part.name))
        seconds = before.seconds + time.perf_counter() - began
        self._outcomes[type(part), part.name] = PartOutcome(part.name, seconds, before.failure or failure)

    @property
    def outcomes(self) -> list[PartOutcome]:
        """What became of every part that was looked at."""
        return list(self._outcomes.values())

    @property
    def failures(self) -> list[str]:
        """Why parts could not be scored, a sentence each."""
        return [outcome.failure for outcome in self.outcomes if outcome.failure]

    @property
    def in_vain(self) -> bool:
        """Whether parts were looked at, and none could be scored."""
        return bool(self.outcomes) and len(self.failures) == len(self.outcomes)


def looks(part: Part, frames: int, evaluation: EvalConfig, models: int) -> int:
    """Return how often the pictures of a part will be looked at; frames: how many it has."""
    stages = set(evaluation.stages)
    if isinstance(part, FogPairs):
        return frames if OF_PAIRS & stages else 0
    if isinstance(part, Stills):
        return models * frames if OF_STILLS & stages else 0
    followed = frames if OF_CLIPS & stages - {"detection"} else 0
    return models * (followed + (-(-frames // evaluation.every) if "detection" in stages else 0))


def scored(
    dataset: EvalDataset,
    models: Sequence[Judged],
    evaluation: EvalConfig,
    dehazer: DehazeConfig,
    runs: Path,
    progress: Progress,
) -> list[Scores]:
    """Show every part to every network; what has no network in it, as dehazing by itself, is done once."""
    pairs: list[ScoredPair] = []
    for part in dataset.fog_pairs if OF_PAIRS & set(evaluation.stages) else ():
        with progress.attempt(part):
            pairs += tuple(see_pairs(part, dehazer, progress.on_picture))  # all of it or nothing
    folders = [runs] if len(models) == 1 else [runs / model.name for model in models]
    return [
        _of_model(dataset, model, evaluation, folder, pairs, progress)
        for model, folder in zip(models, folders, strict=True)
    ]


def _of_model(
    dataset: EvalDataset,
    model: Judged,
    evaluation: EvalConfig,
    runs: Path,
    pairs: Sequence[ScoredPair],
    progress: Progress,
) -> Scores:
    # every data set counts its classes from 0: together they have one list
    names = tuple(dict.fromkeys(name for part in dataset.stills for name in part.names)) or ("pad",)
    stills: list[tuple[SeenStills, PadSpec]] = []
    clips: list[SeenClip] = []
    for part in dataset.stills if OF_STILLS & set(evaluation.stages) else ():
        with progress.attempt(part):
            # what lies beside the pictures is their own and wins
            config = model.config if part.pad is None else replace(model.config, pad=part.pad, diameter_m=None)
            pad = pad_of(config)
            named = _renumbered(part, names)
            seen = see_stills(
                named, model.detector, model.config, pad, stages=evaluation.stages, on_picture=progress.on_picture
            )
            stills.append((seen, pad))
    for clip in dataset.clips if OF_CLIPS & set(evaluation.stages) else ():
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
