"""One recording through the detector and the tag reader: boxes and tags in pixels, no calibration needed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from landtool.config import DetectConfig
from landtool.detect.config import DetectorConfig
from landtool.detect.stage import DetectStage
from landtool.draw import Overlay
from landtool.errors import InputError, UsageError
from landtool.io.local import local_file
from landtool.io.source import SourceInfo
from landtool.pad import PadSpec
from landtool.pipeline import SMALLEST_PX, find
from landtool.run.haze import dehaze_stage
from landtool.run.recording import OnFrame, Results, RunOutcome, RunParts, RunRequest, run_recording
from landtool.run.tags import tag_reader
from landtool.summary import DetectionSummary
from landtool.tags.finder import TagFinder
from landtool.tone import parse_tone
from landtool.types import Frame, LostFrame

if TYPE_CHECKING:
    from landtool.detect.detector import Detector

TABLES = ("detections.csv", "tags.csv", "frames.csv")


@dataclass(frozen=True, eq=False)
class DetectFiles:
    """What the files that settings name hold: the pad, and the network, loaded and checked. model: its file."""

    detector: Detector
    model: Path
    pad: PadSpec
    pad_file: Path | None


def load_files(config: DetectConfig) -> DetectFiles:
    """Read the pad and load the network; it takes no recording, so what is wrong with them is said at once.

    Raises UsageError for a file that cannot be opened and a pad without tags to read, InputError as the files'
    readers do.
    """
    pad = PadSpec.read(local_file(config.pad)) if config.pad else PadSpec()
    if config.tags.which == "pad" and not pad.tags:
        raise UsageError("the pad has no tag to read", file=config.pad, hint="add [[tags]] to it, or pass --tags none")
    return DetectFiles(*load_detector(config.detector), pad, config.pad)


def load_detector(config: DetectorConfig) -> tuple[Detector, Path]:
    """Load the network that is set, or the shipped one; returns it with its file. Raises as `Detector` does."""
    from landtool.detect.detector import SHIPPED_MODEL, Detector  # loads ONNX Runtime

    shipped = Path(str(resources.files("landtool"))) / "models" / SHIPPED_MODEL
    return Detector(config), config.model or shipped


def detect(
    path: Path,
    folder: Path,
    config: DetectConfig,
    *,
    files: DetectFiles | None = None,
    overwrite: bool = False,
    on_start: Callable[[SourceInfo], None] | None = None,
    on_frame: OnFrame | None = None,
) -> RunOutcome:
    """Detect the pad and read tags in one recording and write what was found into `folder`, whole or not at all.

    files: what `load_files` returned for this config, where several recordings share it.
    Raises UsageError, InputError and OutputError as the parts do.
    """
    files = files or load_files(config)
    read = () if files.pad_file is None else (files.pad_file,)
    request = RunRequest("detect", path, folder, config, read, files.model, overwrite, on_start, on_frame)
    return run_recording(request, lambda info: _parts(config, files, info))


def _parts(config: DetectConfig, files: DetectFiles, info: SourceInfo) -> RunParts:
    # of a folder the first picture says nothing of the others
    single = info.kind != "images" or info.frames_declared == 1
    if single and min(info.width, info.height) < SMALLEST_PX:
        reason = f"its pictures of {info.width}x{info.height} pixels are too small to show a pad"
        raise InputError(reason, file=info.path, hint="give the original recording")
    tone = parse_tone(config.tags.tone)
    has_ring = config.refine == "ring" and files.pad.ring is not None
    everywhere = config.tags.which == "all"

    def measure(frames: Iterable[Frame | LostFrame]) -> Results:
        ring_of = files.pad if has_ring else None
        boxes = DetectStage(
            files.detector,
            regions=config.search == "region",
            ring_of=ring_of,
            tone=tone,
            least_score=config.detector.conf,
        )
        tags = None
        if config.tags.which != "none":
            reader = tag_reader(config.tags, files.pad)
            tags = TagFinder(reader, files.pad, everywhere=everywhere, follow=info.has_clock)
        return find(frames, detector=boxes, tags=tags, dehazer=dehaze_stage(config.dehaze, config.dehazer))

    width, height = files.detector.imgsz
    network = f"{files.model.name}, input {width}x{height}, layout {files.detector.layout}"
    summary = DetectionSummary(network, config.detector.conf, reads_tags=config.tags.which != "none")
    notes = ("the pad has no ring: boxes are as the network gives them",) if files.pad.ring is None else ()
    return RunParts(measure, summary, Overlay(), TABLES, notes=notes if config.refine == "ring" else ())
