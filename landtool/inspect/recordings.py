"""Facts of videos, folders of images and MCAP logs."""

from __future__ import annotations

import shlex
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from landtool.camera import Camera
from landtool.errors import InputError
from landtool.inspect.advice import Need, TrackAdvice, tag_range, track_command
from landtool.inspect.clock import Clock, measure_clock
from landtool.inspect.facts import CameraFacts, Facts, Fault, Log, Recording, Request, Scan
from landtool.io.calibration import match_camera, read_camera
from landtool.io.source import MCAP_MAGIC, Source, SourceInfo, open_source
from landtool.io.video_packets import survey_packets
from landtool.pad import PadSpec
from landtool.types import LostFrame

_FAULTS = 20  # told one by one; the counts tell of the rest


@dataclass(frozen=True)
class Look:
    """What is seen of a recording without decoding it. found: packets, files or messages of pictures."""

    format: str
    found: int
    clock: Clock | None
    profile: str = ""
    pixel_format: str = ""
    key_frames: int | None = None
    damaged_packets: int | None = None
    damaged: bool = False
    log: Log | None = None
    notes: tuple[str, ...] = ()


def inspect_recording(path: Path, request: Request) -> Facts:
    """Tell what a recording holds. Raises as `open_source` does, but for a log whose image topic cannot be chosen."""
    if path.is_file() and _is_mcap(path):
        from landtool.inspect.logs import inspect_log

        return inspect_log(path, request)
    with open_source(path, topic=request.topic, fps=request.fps) as source:
        look = _look_video(path) if source.info.kind == "video" else _look_images(source.info)
        return recording_facts(request, look, source)


def _is_mcap(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(MCAP_MAGIC)) == MCAP_MAGIC


def _look_video(path: Path) -> Look:
    survey = survey_packets(path)
    clock = measure_clock(survey.times_ns, "packets", in_order=survey.in_order)
    return Look(
        survey.container.split(" (")[0],
        len(survey.times_ns),
        clock,
        profile=survey.profile,
        pixel_format=survey.pixel_format,
        key_frames=survey.key_frames,
        damaged_packets=survey.damaged,
        damaged=survey.truncated or survey.damaged > 0,
        notes=survey.notes,
    )


def _look_images(info: SourceInfo) -> Look:
    count = info.frames_declared or 0
    # --fps puts them at equal distances
    times = [] if info.duration_ns is None else [index * info.duration_ns // count for index in range(count)]
    name = "image" if info.path.is_file() else "folder of images"
    return Look(name, count, measure_clock(times, "--fps"))


def recording_facts(request: Request, look: Look, source: Source) -> Facts:
    """Put together what was seen of a recording, the camera that fits it, and a scan if one is wanted."""
    info = source.info
    scan, clock = None, look.clock
    if request.scan:
        scan, times = _scan(source, request)
        label = "decoded pictures" if info.kind == "video" else look.clock.source if look.clock else ""
        clock = measure_clock(times, label)
    camera, misfit = fitting_camera(info, request)
    recording = Recording(
        width_px=info.width,
        height_px=info.height,
        encoding=info.encoding,
        profile=look.profile,
        pixel_format=look.pixel_format,
        rotation_deg=info.rotation_deg,
        frames_declared=info.frames_declared,
        frames_found=look.found,
        key_frames=look.key_frames,
        damaged_packets=look.damaged_packets,
        duration_ns=info.duration_ns,
        clock=clock,
        scan=scan,
        log=look.log,
        camera=CameraFacts.of(camera) if camera else None,
        pad=request.pad.name,
        ranges=tuple(tag_range(request.pad, tag, camera) for tag in request.pad.tags) if camera else (),
    )
    return Facts(
        path=info.path,
        kind=info.kind,
        format=look.format,
        bytes=size_of(info.path),
        damaged=look.damaged or (scan is not None and not source.report.complete),
        notes=tuple(dict.fromkeys([*info.notes, *look.notes, *(_scan_notes(scan, source) if scan else ())])),
        facts=recording,
        track=_advice(info, request, look, camera, misfit),
    )


def size_of(path: Path) -> int:
    """Bytes of a file, or of the files directly in a folder."""
    files = [path] if path.is_file() else [entry for entry in path.iterdir() if entry.is_file()]
    return sum(file.stat().st_size for file in files)


def _scan(source: Source, request: Request) -> tuple[Scan, list[int]]:
    """Decode everything once; also the times, of lost frames too."""
    times: list[int] = []
    sizes: Counter[tuple[int, int]] = Counter()
    faults: list[Fault] = []
    for frame in request.watch(source, source.info.frames_declared):
        if frame.t_ns is not None:
            times.append(frame.t_ns)
        lost = isinstance(frame, LostFrame)
        reason = frame.reason if isinstance(frame, LostFrame) else frame.damage
        if not isinstance(frame, LostFrame):
            sizes[frame.image.shape[1], frame.image.shape[0]] += 1
        if reason and len(faults) < _FAULTS:
            faults.append(Fault(frame.index, frame.t_ns, frame.file, lost, reason))
    report = source.report
    counts = report.decoded, report.damaged, report.lost, report.skipped, report.truncated
    return Scan(*counts, tuple((*size, count) for size, count in sizes.most_common()), tuple(faults)), times


def _scan_notes(scan: Scan, source: Source) -> list[str]:
    many = len(scan.sizes) > 1
    return [
        *source.report.notes,
        *(["the pictures are not all of one size, a calibration fits only one"] if many else []),
    ]


def fitting_camera(info: SourceInfo, request: Request) -> tuple[Camera | None, InputError | None]:
    """Return the camera of the pictures as they are given out, and what is wrong if it is of another size.

    A camera of another size but the same shape is scaled, one of another shape is None.
    """
    if request.hfov_deg is not None:
        return Camera.from_hfov(info.width, info.height, request.hfov_deg), None
    camera = read_camera(request.camera, request.camera_name) if request.camera else info.camera
    if camera is None:
        return None, None
    camera = camera.of_turned(info.quarter_turns, info.width, info.height)
    try:
        return match_camera(camera, info.width, info.height, scale=False), None
    except InputError as error:
        try:
            return match_camera(camera, info.width, info.height, scale=True), error
        except InputError:
            return None, error


def given_options(request: Request) -> list[str]:
    """Return the request's options as `landtool track` takes them."""
    options = {
        "--topic": request.topic,
        "--fps": None if request.fps is None else f"{request.fps:g}",
        "--camera": request.camera,
        "--camera-name": request.camera_name,
        "--hfov": None if request.hfov_deg is None else f"{request.hfov_deg:g}",
        "--pad": request.pad_file,
    }
    return [f"{name} {shlex.quote(str(value))}" for name, value in options.items() if value is not None]


def _advice(
    info: SourceInfo, request: Request, look: Look, camera: Camera | None, misfit: InputError | None
) -> TrackAdvice:
    needs: list[Need] = []
    if misfit and camera:
        needs.append(Need("--scale-intrinsics", f"{misfit.reason}; only if they are the whole picture, resized"))
    if misfit and not camera:
        return TrackAdvice("", obstacle=f"{misfit.reason}; {misfit.hint}")
    if not camera:
        needs.append(camera_need("no calibration comes with the pictures", _beside(info.path, "camera.yaml")))
    if look.clock is None and look.found > 1:
        needs.append(Need("--fps F", "images carry no time, and without it there are poses but no track"))
    if not request.pad_file and (pad := _beside(info.path, "pad.toml")):
        needs.append(Need(_option("--pad", pad), f"lies beside it; without one a pad of {_default_pad()} is expected"))
    choices = ego_choices(look.log)
    if ego := _beside(info.path, "ego.csv"):
        choices = (Need(_option("--ego", ego), "the drone's own poses, they lie beside it"), *choices)
    return TrackAdvice(track_command(info.path, given_options(request), needs), tuple(needs), choices)


def _beside(recording: Path, ending: str) -> Path | None:
    """Return the file beside a recording that is called as it is, with another ending."""
    path = recording.parent / f"{recording.name if recording.is_dir() else recording.stem}.{ending}"
    return path if path.is_file() else None


def _option(name: str, path: Path) -> str:
    return f"{name} {shlex.quote(str(path))}"


def _default_pad() -> str:
    return f"D = {PadSpec().diameter_m:g} m"


def camera_need(why: str, beside: Path | None = None) -> Need:
    """Ask for a calibration; beside: one that lies beside the recording."""
    if beside is not None:
        return Need(_option("--camera", beside), "the calibration that lies beside it")
    return Need("--camera CAM.yaml", f"{why}; --hfov DEG stands in for a file nobody has")


def ego_choices(log: Log | None) -> tuple[Need, ...]:
    """Offer the poses a log holds: they may be the drone's own."""
    names = [topic.name for topic in log.topics if topic.role == "pose" and topic.messages] if log else []
    return tuple(Need(f"--ego {shlex.quote(name)}", "if these are the drone's own poses") for name in names)
