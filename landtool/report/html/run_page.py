"""The report of one run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from landtool.report.html.chart import draw
from landtool.report.html.charts_run import run_charts
from landtool.report.html.film import Budget, Film, VideoMode, film, stills
from landtool.report.html.flight import Flight, read_flight
from landtool.report.html.folders import VIDEO_FILE, Folder
from landtool.report.html.judgement import judge_run
from landtool.report.html.page import Bar, Page, Section, Still, Table, flat, text_of
from landtool.report.html.stages import speed_note
from landtool.report.html.timeline import timeline
from landtool.report.html.worst import Moment, worst
from landtool.report.html.worst_run import UNNOTABLE, run_faults

_KEY = "run"
# The worst frames are to tell of the whole flight: so many times they would fit in it
_SPREAD = 30


def run_page(run: Folder, output: Path, video: VideoMode) -> Page:
    """Put together the report of a run."""
    record = run.record
    flight = read_flight(run)
    section, made = run_section(run, flight, _KEY, _name(record), output, video, Budget(), has_truth=False)
    pictures: tuple[Still, ...] = ()
    note = f"No frame can be shown: {_without_frames(run)}."
    if flight is not None and made is not None:
        moments = worst(run_faults(flight), spread(flight))
        pictures = tuple(_stills(flight, made, moments))
        note = "" if pictures else f"Nothing went wrong that is worth showing: {UNNOTABLE}."
    return Page(
        kind="Run of landtool track",
        title=_name(record),
        judgement=judge_run(record),
        sections=(section,),
        worst=pictures,
        worst_note=note,
        speed=speed_bars(record["timings"]),
        speed_head=("stage", "mean, ms a frame", "frames", "total, s"),
        speed_note=speed_note(record["timings"]),
        missing=run.missing,
        notes=tuple(str(note) for note in record["notes"]),
        facts=_facts(record),
    )


def run_section(
    run: Folder,
    flight: Flight | None,
    key: str,
    name: str,
    output: Path,
    video: VideoMode,
    budget: Budget,
    *,
    has_truth: bool,
) -> tuple[Section, Film | None]:
    """Return video, timeline and charts of a run, and its film; what is missing is said in it.

    has_truth: the run is one of an evaluation, which compares with truth.
    """
    if flight is None:
        return Section(key, name, None, None, (), missing=(f"No timeline: {_without_frames(run)}.",)), None
    without = _without_video(run.record, "eval" if has_truth else "track")
    made = film(run.video, flight, output, video, budget, without=without)
    charts = tuple(draw(chart) for chart in run_charts(flight, has_truth=has_truth))
    missing = () if flight.has_clock else ("The recording has no clock: the timeline counts frames.",)
    return Section(key, name, made, timeline(flight), charts, missing=missing), made


def _without_video(record: Mapping[str, Any], command: str) -> str:
    """Return why a run has no video: by its own record it saved one, or it was not asked to."""
    if "video" in (record["config"].get("save") or ()):
        return f"{VIDEO_FILE} is missing: the run saved one, but it is not in its folder any more"
    return f"the run saved none; give `landtool {command}` --save csv,video for one"


def _without_frames(run: Folder) -> str:
    """Say why frames.csv tells of no frame."""
    return next((said for said in run.missing if said.startswith("frames.csv ")), "frames.csv has no row")


def spread(flight: Flight) -> float:
    """Return how far apart the worst frames are to be, in the unit of the flight's time."""
    known = flight.at[np.isfinite(flight.at)]
    return float(known.max() - known.min()) / _SPREAD if len(known) else 0.0


def speed_bars(timings: Mapping[str, Any]) -> tuple[Bar, ...]:
    """Return the time a frame of every stage, with its share of the slowest one's."""
    slowest = max((float(of["mean_ms"]) for of in timings.values()), default=0.0) or 1.0
    return tuple(
        Bar(
            stage,
            100.0 * float(of["mean_ms"]) / slowest,
            (f"{of['mean_ms']:.2f}", str(of["frames"]), f"{of['total_s']:.2f}"),
        )
        for stage, of in timings.items()
    )


def _stills(flight: Flight, made: Film, moments: list[Moment]) -> list[Still]:
    pictures = stills(made, [moment.fault.frame for moment in moments])
    shown = []
    for moment, jpeg in zip(moments, pictures, strict=True):
        i = moment.fault.frame
        at = f"{moment.fault.at:.2f} s, " if flight.has_clock else ""
        words = tuple(dict.fromkeys((*moment.words, *([flight.reason[i]] if flight.reason[i] else []))))
        shown.append(Still(f"{at}frame {flight.index[i]}", words, jpeg, _KEY, moment.fault.at))
    return shown


def _name(record: Mapping[str, Any]) -> str:
    inputs = record["inputs"]
    return Path(str(inputs[0]["path"])).name if inputs else "run"


def _facts(record: Mapping[str, Any]) -> tuple[Table, ...]:
    files = [*record["inputs"], *([record["model"]] if record.get("model") else [])]
    verdict = {key: value for key, value in record["verdict"].items() if key != "lines"}
    return (
        Table("Inputs", ("file", "SHA-256"), tuple((str(f["path"]), str(f["sha256"])) for f in files)),
        Table("Frames", ("of the input", "count"), tuple(flat(record["counts"]))),
        Table("Verdict in numbers", ("name", "value"), tuple(flat(verdict))),
        Table("Settings", ("name", "value"), tuple(flat(record["config"]))),
        Table("Versions", ("package", "version"), tuple((k, text_of(v)) for k, v in record["versions"].items())),
    )
