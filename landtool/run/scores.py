"""From what was seen to numbers: the errors and the metrics of every stage of one network's run over a dataset."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from landtool.config import EvalConfig, TrackConfig
from landtool.evaluate.bootstrap import UNDEFINED, Estimate
from landtool.evaluate.boxes import BOX_COLUMNS, box_rows
from landtool.evaluate.clock import check_clock, clock_metrics
from landtool.evaluate.dehazing import DEHAZE_ERROR_COLUMNS, ScoredPair, dehaze_error_row, dehaze_metrics
from landtool.evaluate.detection_metrics import ScoredPicture, class_notes, detection_curve, detection_metrics
from landtool.evaluate.downstream import downstream_metrics
from landtool.evaluate.metric import Metric, Stage, metric
from landtool.evaluate.pose_errors import (
    POSE_ERROR_COLUMNS,
    PoseError,
    pose_error_row,
    pose_errors,
    still_pose_errors,
)
from landtool.evaluate.pose_metrics import pose_metrics
from landtool.evaluate.prediction_errors import (
    PREDICTION_ERROR_COLUMNS,
    PredictionError,
    prediction_error_row,
    prediction_errors,
    prediction_metrics,
)
from landtool.evaluate.record import CurveRecord, SpeedRecord
from landtool.evaluate.tag_errors import (
    TAG_ERROR_COLUMNS,
    TagError,
    still_tag_errors,
    tag_error_rows,
    tag_errors,
    tag_metrics,
)
from landtool.evaluate.track_errors import TRACK_ERROR_COLUMNS, TrackError, track_error_row, track_errors
from landtool.evaluate.track_metrics import track_metrics
from landtool.io.tables import Columns, Row
from landtool.pad import PadSpec
from landtool.run.scoring_clips import Followed, SeenClip
from landtool.run.scoring_stills import SeenStills
from landtool.types import FrameResult


@dataclass(frozen=True)
class ErrorTable:
    """A table of errors: its columns, and the rows of one network."""

    columns: Columns
    rows: Callable[[Scores], Iterable[Row]]


@dataclass(frozen=True, eq=False)
class Scores:
    """What one network's run over a dataset came to.

    model: its name. classes: the names it has, None where it tells none. names: of the dataset's classes, by their ids
    in every picture. pad: of the labelled pictures. stills, clips: what was seen. pairs: of the dehazer, which has
    nothing to do with the network.
    """

    model: str
    classes: tuple[str, ...] | None
    names: tuple[str, ...]
    config: TrackConfig
    evaluation: EvalConfig
    stills: tuple[tuple[SeenStills, PadSpec], ...]
    clips: tuple[SeenClip, ...]
    pairs: tuple[ScoredPair, ...] = ()

    @cached_property
    def pictures(self) -> list[ScoredPicture]:
        """All pictures the network has looked at."""
        of_stills = [picture for seen, _ in self.stills for picture in seen.pictures]
        return of_stills + [picture for clip in self.clips for picture in clip.pictures]

    @cached_property
    def poses(self) -> list[PoseError]:
        """The errors of poses in clips."""
        return [e for c, run in self.followed for e in pose_errors(c.name, run.results, c.truth, run.camera, run.pad)]

    @cached_property
    def still_poses(self) -> list[PoseError]:
        """The errors of poses in single pictures."""
        return [error for seen, pad in self.stills for error in still_pose_errors(seen.poses, pad)]

    @cached_property
    def tags(self) -> list[TagError]:
        """The errors of tags in clips and single pictures."""
        of_stills = [error for seen, pad in self.stills for error in still_tag_errors(seen.poses, pad)]
        runs = self.followed
        return of_stills + [e for c, run in runs for e in tag_errors(c.name, run.results, c.truth, run.camera, run.pad)]

    @cached_property
    def tracks(self) -> list[TrackError]:
        """The errors of tracks."""
        return [e for c, run in self.followed for e in track_errors(c.name, run.results, c.truth, run.body_T_camera)]

    @cached_property
    def predictions(self) -> list[PredictionError]:
        """The errors of predicted places."""
        runs = self.followed
        return [e for c, run in runs for e in prediction_errors(c.name, run.results, c.truth, run.body_T_camera)]

    @cached_property
    def followed(self) -> list[tuple[SeenClip, Followed]]:
        """The clips that were followed as `landtool track` does."""
        return [(clip, clip.followed) for clip in self.clips if clip.followed is not None]

    def metrics(self) -> list[Metric]:
        """Return the numbers of the stages that are asked for."""
        made: list[Metric] = []
        for stage in self.evaluation.stages:
            made += _OF_STAGE[stage](self)
        return [replace(m, model=self.model) for m in (*made, *_speed_metrics(self.speed))]

    def curve(self) -> CurveRecord:
        """Return precision and recall by score."""
        curve = detection_curve(self.pictures, self.names)
        values = (tuple(float(v) for v in column) for column in (curve.score, curve.precision, curve.recall))
        return CurveRecord(self.model, *values)

    @cached_property
    def speed(self) -> tuple[SpeedRecord, ...]:
        """What each stage of `landtool track` and of the network's looks took."""
        spent: dict[str, list[float]] = {}
        for _, run in self.followed:
            for stage, time in run.timings.items():
                _add(spent, stage, time.frames, time.total_s)
            _add(spent, "whole", len(run.results), run.wall_s)
        looked = [result for seen, _ in self.stills for result in seen.looked]
        for result in (*looked, *(result for clip in self.clips for result in clip.looked)):
            _add(spent, "look", 1, _look_s(result))
        return tuple(SpeedRecord(self.model, stage, int(n), s) for stage, (n, s) in spent.items())

    def notes(self) -> list[str]:
        """Return what makes the numbers less than they seem."""
        said = class_notes(self.pictures, self.names, self.classes or self.names)
        said += [note for seen, _ in self.stills for note in seen.notes]
        for clip in self.clips:
            said += [*clip.notes, *clip.truth.missing]
        return said

    @property
    def lossy(self) -> bool:
        """Whether recordings were not decoded whole."""
        return any(clip.lossy for clip in self.clips)


def _detection(scores: Scores) -> list[Metric]:
    conf, alarm_conf = scores.config.detector.conf, scores.evaluation.alarm_conf
    return detection_metrics(scores.pictures, scores.names, conf=conf, alarm_conf=alarm_conf)


def _pose(scores: Scores) -> list[Metric]:
    still: Stage = "still_pose"
    return [*tag_metrics(scores.tags), *pose_metrics(scores.poses), *pose_metrics(scores.still_poses, still)]


def _track(scores: Scores) -> list[Metric]:
    nis_dof = 4 if scores.config.tracker.measurement == "paper" else 2
    checks = [check_clock(clip.name, run.results, clip.truth) for clip, run in scores.followed]
    ahead = prediction_metrics(scores.predictions, scores.config.tracker.horizons_s)
    return [*track_metrics(scores.tracks, nis_dof), *ahead, *clock_metrics(checks)]


def _dehaze(scores: Scores) -> list[Metric]:
    hazy = [picture for seen, _ in scores.stills for picture in seen.hazy]
    clear = [change for seen, _ in scores.stills for change in seen.clear]
    worth = downstream_metrics(hazy, scores.pictures, scores.names, conf=scores.config.detector.conf)
    return [*dehaze_metrics(scores.pairs, clear), *worth]


_OF_STAGE: dict[str, Callable[[Scores], list[Metric]]] = {
    "detection": _detection,
    "pose": _pose,
    "track": _track,
    "dehaze": _dehaze,
}


def _speed_metrics(speed: Sequence[SpeedRecord]) -> Iterator[Metric]:
    for record in speed:
        mean_ms = (
            Estimate(1e3 * record.seconds / record.frames, None, None, record.frames) if record.frames else UNDEFINED
        )
        yield metric("speed", f"{record.stage}_ms", mean_ms, "lower")
        if record.stage == "whole":
            fps = Estimate(record.frames / record.seconds, None, None, record.frames) if record.seconds else UNDEFINED
            yield metric("speed", "track_fps", fps, "higher")


def _look_s(result: FrameResult) -> float:
    return sum(result.stage_seconds.values())


def _add(spent: dict[str, list[float]], stage: str, frames: int, seconds: float) -> None:
    sums = spent.setdefault(stage, [0.0, 0.0])
    sums[0] += frames
    sums[1] += seconds


def _track_rows(scores: Scores) -> Iterator[Row]:
    return (row for error in scores.tracks if (row := track_error_row(scores.model, error)) is not None)


def _box_rows(scores: Scores) -> Iterator[Row]:
    conf, alarm_conf = scores.config.detector.conf, scores.evaluation.alarm_conf
    return ((scores.model, *row) for row in box_rows(scores.pictures, scores.names, conf, alarm_conf))


# The tables of errors and the stage each belongs to
ERROR_TABLES: dict[str, tuple[str, ErrorTable]] = {
    "boxes.csv": ("detection", ErrorTable({"model": str, **BOX_COLUMNS}, _box_rows)),
    "pose_errors.csv": (
        "pose",
        ErrorTable(POSE_ERROR_COLUMNS, lambda s: (pose_error_row(s.model, e) for e in (*s.poses, *s.still_poses))),
    ),
    "tag_errors.csv": ("pose", ErrorTable(TAG_ERROR_COLUMNS, lambda s: tag_error_rows(s.model, s.tags))),
    "track_errors.csv": ("track", ErrorTable(TRACK_ERROR_COLUMNS, _track_rows)),
    "prediction_errors.csv": (
        "track",
        ErrorTable(PREDICTION_ERROR_COLUMNS, lambda s: (prediction_error_row(s.model, e) for e in s.predictions)),
    ),
    "dehaze_errors.csv": ("dehaze", ErrorTable(DEHAZE_ERROR_COLUMNS, lambda s: map(dehaze_error_row, s.pairs))),
}
