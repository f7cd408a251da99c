"""The report of an evaluation."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from landtool.errors import LandtoolError
from landtool.evaluate.record import metric_of
from landtool.evaluate.words import headline_rows
from landtool.io.images import SUFFIXES, PictureError, read_picture
from landtool.io.video_stills import as_jpeg
from landtool.report.html.chart import draw
from landtool.report.html.charts_eval import clip_charts, evaluation_charts
from landtool.report.html.film import STILL_PX, Budget, Film, VideoMode, stills
from landtool.report.html.flight import Flight, read_flight
from landtool.report.html.folders import Folder, clip_folders, read_run
from landtool.report.html.gate_table import gate_table
from landtool.report.html.judgement import judge_evaluation
from landtool.report.html.page import Bar, Page, Section, Still, Table, flat, rounded, text_of
from landtool.report.html.run_page import run_section
from landtool.report.html.stages import speed_note
from landtool.report.html.worst import Fault, Moment, worst
from landtool.report.html.worst_eval import UNNOTABLE, evaluation_faults

_APART_S = 0.5  # between two of the worst frames of one clip
_Clip = tuple[Section, Film | None, Flight | None]


def evaluation_page(evaluation: Folder, output: Path, video: VideoMode) -> Page:
    """Put together the report of an evaluation."""
    record, tables = evaluation.record, evaluation.tables
    clips = _clips(evaluation, output, video)
    moments = worst(evaluation_faults(tables), _APART_S)
    dataset = record["dataset"]
    missing = list(evaluation.missing)
    if not clips and any(part.get("kind") == "clip" for part in dataset.get("parts", [])):
        missing.append("runs/ holds no run of the clips, so they have no timeline and no video")
    return Page(
        kind="Evaluation by landtool eval",
        title=str(dataset.get("name") or evaluation.path.name),
        judgement=judge_evaluation(record),
        sections=tuple(section for section, _, _ in clips),
        charts=tuple(draw(chart) for chart in evaluation_charts(record, tables)),
        gate=gate_table(record.get("gate")),
        tables=(_in_short(record),),
        slices=(*_metrics(record), *_slices(record)),
        worst=tuple(_stills(moments, clips, Path(str(dataset.get("name"))))),
        worst_note="" if moments else f"Nothing went wrong that is worth showing: {UNNOTABLE}.",
        speed=_speed(record.get("speed") or []),
        speed_note=speed_note(str(row["stage"]) for row in record.get("speed") or []),
        speed_head=("stage", "mean, ms a frame", "frames", "total, s"),
        missing=tuple(missing),
        notes=tuple(str(note) for note in record.get("notes") or []),
        facts=_facts(record),
    )


def _clips(evaluation: Folder, output: Path, video: VideoMode) -> list[_Clip]:
    budget = Budget()
    models = [str(model.get("name")) for model in evaluation.record["models"]]

    def by_model(clip: tuple[str, Path]) -> int:
        """The models come in the order of their numbers, each with its clips."""
        model = _model_and_clip(clip[0], evaluation.record)[0]
        return models.index(model) if model else 0

    found: list[_Clip] = []
    for number, (name, path) in enumerate(sorted(clip_folders(evaluation.path), key=by_model)):
        key = f"clip-{number}"
        try:
            run = read_run(path)
        except LandtoolError as error:
            found.append((Section(key, name, None, None, (), missing=(f"No run: {error.reason}.",)), None, None))
            continue
        flight = read_flight(run)
        section, made = run_section(run, flight, key, name, output, video, budget, has_truth=True)
        model, clip = _model_and_clip(name, evaluation.record)
        start_ns = None if flight is None else next((t for t in flight.t_ns if t is not None), None)
        against = tuple(draw(chart) for chart in clip_charts(evaluation.tables, clip, model, start_ns))
        lines = tuple(str(line) for line in run.record["verdict"].get("lines") or ())
        charts = (*against, *section.charts)
        missing = (*section.missing, *run.missing)
        found.append((Section(key, name, made, section.timeline, charts, lines, missing), made, flight))
    return found


def _model_and_clip(name: str, record: Mapping[str, Any]) -> tuple[str, str]:
    """Split the name of a run's folder: of several models each has its own; the name of a clip may be a path."""
    models = [str(model.get("name")) for model in record["models"]]
    first, _, rest = name.partition("/")
    return (first, rest) if len(models) > 1 and first in models else ("", name)


def _stills(moments: Sequence[Moment], clips: Sequence[_Clip], data: Path) -> list[Still]:
    """Return the worst frames; those of a clip whose video is there with their pictures, and a way to it.

    data: where the dataset was; of its labelled pictures the pictures themselves are shown, if they are still there.
    """
    wanted: dict[int, list[tuple[int, int]]] = {}
    places = [_in_clip(moment.fault, clips) for moment in moments]
    for i, place in enumerate(places):
        if place is not None:
            wanted.setdefault(place[0], []).append((i, place[1]))
    pictures: dict[int, str] = {}
    for number, of in wanted.items():
        made = clips[number][1]
        if made is not None:
            pictures |= dict(zip((i for i, _ in of), stills(made, [row for _, row in of]), strict=True))
    shown = []
    for i, (moment, place) in enumerate(zip(moments, places, strict=True)):
        name = moment.fault.place
        if Path(name).suffix.lower() in SUFFIXES:  # a labelled picture
            shown.append(Still(name, moment.words, _picture(data, name)))
            continue
        title = f"{name}, frame {moment.fault.frame}".removeprefix(", ")
        if place is None:
            shown.append(Still(title, moment.words))
            continue
        section, _, flight = clips[place[0]]
        at = float(flight.at[place[1]]) if flight is not None else 0.0
        shown.append(Still(title, moment.words, pictures.get(i, ""), section.key, at))
    return shown


def _picture(data: Path, name: str) -> str:
    """Return a labelled picture of the dataset as a base64 JPEG, "" where it is not there or cannot be read."""
    # a dataset that is one part has the folder's own name
    for path in (data / name, data / name.removeprefix(f"{data.absolute().name}/")):
        if path.is_file():
            try:
                jpeg = as_jpeg(read_picture(path).image, STILL_PX)
            except PictureError:
                return ""
            return "" if jpeg is None else base64.b64encode(jpeg).decode("ascii")
    return ""


def _in_clip(fault: Fault, clips: Sequence[_Clip]) -> tuple[int, int] | None:
    """Return which clip a fault is in, and which row of its flight; None where no run of it is there."""
    for number, (section, _, flight) in enumerate(clips):
        names = (section.name, section.name.rsplit("/", 1)[-1])
        if flight is not None and fault.place.strip() in names and fault.frame in flight.index:
            return number, flight.index.index(fault.frame)
    return None


def _in_short(record: Mapping[str, Any]) -> Table:
    """Return the numbers that are worth a line of their own, in words."""
    models, rows = headline_rows([metric_of(row) for row in record["metrics"]])
    return Table("In short", ("", *(model or "value" for model in models)), tuple((text, *of) for text, of in rows))


def _metrics(record: Mapping[str, Any]) -> list[Table]:
    """Return the numbers about all of the data, a table a stage, a column a model."""
    whole = [metric for metric in record["metrics"] if not metric["slice"]]
    return [
        Table(_title(stage), ("number", "better", *_models(of)), _by_name(of, "name")) for stage, of in _staged(whole)
    ]


def _slices(record: Mapping[str, Any]) -> list[Table]:
    parts = [
        metric | {"part": f"{metric['name']}, {metric['slice']}"} for metric in record["metrics"] if metric["slice"]
    ]
    return [
        Table(f"{_title(stage)}, by slices", ("number", "better", *_models(of)), _by_name(of, "part"))
        for stage, of in _staged(parts)
    ]


def _staged(metrics: Sequence[dict[str, Any]]) -> list[tuple[str, list[dict[str, Any]]]]:
    stages = dict.fromkeys(str(metric["stage"]) for metric in metrics)
    return [(stage, [metric for metric in metrics if metric["stage"] == stage]) for stage in stages]


def _title(stage: str) -> str:
    return stage.replace("_", " ").capitalize()


def _models(metrics: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(str(metric["model"]) or "value" for metric in metrics))


def _by_name(metrics: Sequence[Mapping[str, Any]], key: str) -> tuple[tuple[str, ...], ...]:
    models = _models(metrics)
    rows: dict[str, dict[str, str]] = {}
    better: dict[str, str] = {}
    for metric in metrics:
        name = str(metric[key])
        better[name] = _better(metric)
        rows.setdefault(name, {})[str(metric["model"]) or "value"] = _said(metric)
    return tuple((name, better[name], *(of.get(model, "") for model in models)) for name, of in rows.items())


def _better(metric: Mapping[str, Any]) -> str:
    if metric["better"] == "expected":
        return f"near {rounded(metric['expected'])}"
    return "" if metric["better"] == "neither" else str(metric["better"])


def _said(metric: Mapping[str, Any]) -> str:
    made_of = f"{metric['count']} of {metric['of']}"
    if metric["value"] is None:
        return f"undefined, {made_of}"
    if metric["low"] is None or metric["high"] is None:
        return f"{rounded(metric['value'])}, {made_of}"
    return f"{rounded(metric['value'])} ({rounded(metric['low'])} to {rounded(metric['high'])}), {made_of}"


def _speed(rows: Sequence[Mapping[str, Any]]) -> tuple[Bar, ...]:
    times = [(row, 1e3 * row["seconds"] / row["frames"] if row["frames"] else None) for row in rows]
    slowest = max((ms for _, ms in times if ms is not None), default=0.0) or 1.0
    return tuple(
        Bar(
            " ".join(filter(None, (str(row["stage"]), str(row["model"])))),
            0.0 if ms is None else 100.0 * ms / slowest,
            ("undefined, 0 of 0" if ms is None else f"{ms:.2f}", str(row["frames"]), f"{row['seconds']:.2f}"),
        )
        for row, ms in times
    )


def _facts(record: Mapping[str, Any]) -> tuple[Table, ...]:
    dataset = record["dataset"]
    parts = tuple(
        (str(part.get("name")), str(part.get("kind")), str(part.get("frames"))) for part in dataset.get("parts", [])
    )
    models = tuple(
        (str(model.get("name")), text_of(model.get("file")), text_of(model.get("sha256"))) for model in record["models"]
    )
    return (
        Table("Models", ("name", "file", "SHA-256"), models),
        Table("Data", ("part", "kind", "frames"), parts),
        Table("Digest of the data", ("name", "SHA-256"), ((str(dataset.get("name")), text_of(dataset.get("digest"))),)),
        Table("Settings", ("name", "value"), tuple(flat(record.get("config") or {}))),
        Table("Versions", ("package", "version"), tuple((k, text_of(v)) for k, v in record["versions"].items())),
    )
