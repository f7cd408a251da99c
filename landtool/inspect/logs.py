"""Facts of MCAP logs."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

from landtool.errors import LandtoolError
from landtool.inspect.advice import Need, TrackAdvice, track_command
from landtool.inspect.clock import measure_clock
from landtool.inspect.facts import Facts, Log, Recording, Request, Topic
from landtool.inspect.recordings import Look, camera_need, ego_choices, given_options, recording_facts
from landtool.io.mcap import McapSummary, describe_mcap
from landtool.io.mcap_times import LogTimes, read_image_times
from landtool.io.source import open_source


def inspect_log(path: Path, request: Request) -> Facts:
    """Tell what an MCAP log holds, and, if one image topic is chosen or the only one, what its pictures are.

    Raises InputError when it is no log that can be read, and as `open_source` does when `request` asks for a topic.
    """
    summary = describe_mcap(path)
    times = read_image_times(path, [topic.name for topic in summary.image_topics])
    log = _log(summary, times)
    notes = tuple(dict.fromkeys([*summary.problems, *times.notes]))
    damaged = times.truncated or times.lost_chunks > 0
    try:
        source = open_source(path, topic=request.topic, fps=request.fps)
    except LandtoolError as error:
        if request.topic is not None or request.fps is not None:
            raise
        recording, track = _without_pictures(log, request), _advice(path, request, log, error)
        # pictures that cannot be read are a loss, a choice between topics or their absence is none
        damaged |= bool(track.obstacle and summary.image_topics)
        return Facts(path, "mcap", "MCAP log", path.stat().st_size, damaged, notes, recording, track)
    with source:
        name = source.info.topic
        mine = next(topic for topic in log.topics if topic.name == name)
        damaged |= times.topics[name].broken > 0
        look = Look("MCAP log", mine.messages, mine.clock, damaged=damaged, notes=notes)
        return recording_facts(request, replace(look, log=replace(log, topic=name)), source)


def _log(summary: McapSummary, times: LogTimes) -> Log:
    topics = []
    for topic in summary.topics:
        seen = times.topics.get(topic.name)
        owner = summary.camera_topic_of(topic.name) if seen else None
        clock = measure_clock(seen.times_ns, seen.clock) if seen else None
        calibration = owner.name if owner else ""
        topics.append(Topic(topic.name, topic.type, topic.encoding, topic.count, topic.role, calibration, clock))
    return Log(
        profile=summary.profile,
        library=summary.library,
        indexed=summary.indexed,
        cut=times.truncated,
        lost_chunks=times.lost_chunks,
        first_ns=summary.start_ns,
        last_ns=summary.end_ns,
        topics=tuple(topics),
        topic="",
    )


def _without_pictures(log: Log, request: Request) -> Recording:
    images = sum(topic.messages for topic in log.topics if topic.role == "image")
    unknown = (None, None, "", "", "", 0, None, images, None, None, None, None, None)
    return Recording(*unknown, log, None, request.pad.name, ())


def _advice(path: Path, request: Request, log: Log, error: LandtoolError) -> TrackAdvice:
    """Say which topic to choose, or why there is nothing to choose from."""
    if not any(topic.role == "image" for topic in log.topics):
        return TrackAdvice("", obstacle="there is no image topic; record the camera's")
    images = [topic for topic in log.topics if topic.role == "image" and topic.messages]
    if len(images) < 2:
        return TrackAdvice("", obstacle=f"{error.reason}; {error.hint}")
    others = " or ".join(f"--topic {shlex.quote(topic.name)}" for topic in images[1:])
    needs = [Need(f"--topic {shlex.quote(images[0].name)}", f"one of {len(images)} image topics, else {others}")]
    if not (request.camera or request.hfov_deg or images[0].calibration):
        needs.append(camera_need(f"no calibration topic belongs to {images[0].name}"))
    return TrackAdvice(track_command(path, given_options(request), needs), tuple(needs), ego_choices(log))
