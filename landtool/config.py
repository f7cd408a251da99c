"""The settings of a run: typed, with defaults, read from TOML; what the user types on the command line wins over it."""

from __future__ import annotations

import tomllib
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from types import NoneType
from typing import Any, Literal, TypeVar, get_args, get_origin

from landtool.dehaze.config import DehazeConfig
from landtool.detect.config import DetectorConfig
from landtool.errors import InputError, UsageError
from landtool.families import canonical_name
from landtool.io.local import local_file
from landtool.pad import refuse_unknown_keys
from landtool.synth.domain import Domain
from landtool.tone import parse_tone
from landtool.tracking.tracker import TrackerConfig

Settings = TypeVar("Settings")
SAVES = ("video", "csv")  # of landtool detect, and its default
TRACK_SAVED = (*SAVES, "plot")  # the default of landtool track
TRACK_SAVES = (*TRACK_SAVED, "mcap", "tum")
EVAL_STAGES = ("detection", "pose", "track", "dehaze")
EVAL_SAVES = ("csv", "video")
# What a number must lie in; the command line's options have the same
BOUNDS = {
    "hfov_deg": (1.0, 170.0),
    "diameter_m": (0.01, 100.0),
    "fps": (0.001, 1000.0),
    "switch_altitude_m": (0.05, 10_000.0),
}

AUTO_TONE = "auto"

# For the network's sake: what is less hazy it sees as well as without, and clear frames are to stay as they are
LOOK_THROUGH = DehazeConfig(haze_on=0.55, haze_off=0.5, again_s=0.1)


@dataclass(frozen=True)
class TagConfig:
    """How tags are read."""

    # pad: only the pad's own tags, where they are expected; all: every tag of `family` in every whole picture; none:
    # no tags, with `landtool detect` only
    which: Literal["pad", "all", "none"] = "pad"
    # read with which = "all", besides the families of the pad
    family: str = "tag36h11"
    # the pictures' tone curve: srgb, none, or a gamma; with `landtool track` also auto: srgb, until the pad's own edges
    # tell another
    tone: str = "srgb"
    # bits the decoder may correct, 0 to 2
    max_hamming: int = 1
    # least mean distance of a bit from its threshold, grey levels
    min_margin: float = 20.0

    def __post_init__(self) -> None:
        canonical_name(self.family)
        if self.tone != AUTO_TONE:
            parse_tone(self.tone)
        if not 0 <= self.max_hamming <= 2:
            raise UsageError(f"max_hamming = {self.max_hamming} is impossible", hint="give 0 to 2")
        if not 0.0 <= self.min_margin <= 255.0:
            raise UsageError(f"min_margin = {self.min_margin:g} is impossible", hint="give 0 to 255")


@dataclass(frozen=True)
class TrackConfig:
    """Everything `landtool track` can be told, except its inputs and its output folder."""

    # calibration file, and the name of one camera in a Kalibr camchain
    camera: Path | None = None
    camera_name: str | None = None
    # horizontal field of view that stands in for a calibration nobody has, degrees
    hfov_deg: float | None = None
    # scale a calibration made at another resolution of the same aspect
    scale_intrinsics: bool = False
    # pad TOML, and a ring diameter that replaces its own, metres
    pad: Path | None = None
    diameter_m: float | None = None
    # camera on the body: a mount TOML; default straight down
    mount: Path | None = None
    # the drone's own poses: a CSV or TUM file, or a topic of the MCAP input
    ego: str | None = None
    # image topic of an MCAP log; frame rate of a folder of images
    topic: str | None = None
    fps: float | None = None
    # outputs to write
    save: tuple[str, ...] = TRACK_SAVED
    # when frames are dehazed: auto: when they are hazy; the tags of a dehazed frame are read in it where the original
    # shows none
    dehaze: Literal["auto", "on", "off"] = "auto"
    dehazer: DehazeConfig = LOOK_THROUGH
    # how the measurements are used: fuse: whatever is seen best in each frame; paper: boxes alone above the switch
    # altitude, the tag alone below it, as in the paper
    policy: Literal["fuse", "paper"] = "fuse"
    # height over the pad at which the far stage gives way to the near one, metres; none: from where the tag is readable
    # by this camera
    switch_altitude_m: float | None = None
    # smooth the tracks over the whole run, too (Rauch-Tung-Striebel): further columns in tracks.csv
    smooth: bool = False
    detector: DetectorConfig = field(default_factory=DetectorConfig)
    tags: TagConfig = field(default_factory=lambda: TagConfig(tone=AUTO_TONE))
    tracker: TrackerConfig = field(default_factory=TrackerConfig)

    def __post_init__(self) -> None:
        _refuse_unknown_outputs(self.save, TRACK_SAVES)
        _refuse_out_of_bounds(self)
        if self.smooth and "csv" not in self.save:
            raise UsageError("smoothing adds columns to tracks.csv, which is not saved", hint="add csv to --save")
        if self.tags.which == "none":
            raise UsageError("a track without tags has nothing to measure", hint="give tags.which = pad or all")
        if self.camera_name is not None and self.camera is None:
            raise UsageError("a camera's name, but no file to find it in", hint="give the camchain with --camera")
        if self.camera is not None and self.hfov_deg is not None:
            raise UsageError("--camera and --hfov exclude each other", hint="keep the calibration file")


@dataclass(frozen=True)
class DetectConfig:
    """Everything `landtool detect` can be told, except its inputs and its output folder."""

    # where the network looks: frame: at every whole picture; region: after a detection around the place it is
    # expected at, at the whole picture every 15 frames and whenever nothing is seen there
    search: Literal["frame", "region"] = "frame"
    # ring: the boxes of the network's class `pad` are moved onto the red ring, to a fraction of a pixel; none: they
    # stay as the network gives them
    refine: Literal["ring", "none"] = "ring"
    # pad TOML: whose tags are read, and whether it has a ring
    pad: Path | None = None
    # image topic of an MCAP log; frame rate of a folder of images
    topic: str | None = None
    fps: float | None = None
    # outputs to write
    save: tuple[str, ...] = SAVES
    # when frames are dehazed: auto: when they are hazy; the network looks at the dehazed frame, and at the original
    # where that shows nothing; tags are read in the original, and in the dehazed frame where that shows none
    dehaze: Literal["auto", "on", "off"] = "auto"
    dehazer: DehazeConfig = LOOK_THROUGH
    detector: DetectorConfig = field(default_factory=DetectorConfig)
    tags: TagConfig = field(default_factory=TagConfig)

    def __post_init__(self) -> None:
        if self.tags.tone == AUTO_TONE:
            raise UsageError("without a camera no tone curve can be gauged", hint="give tone = srgb, none or a gamma")
        _refuse_unknown_outputs(self.save, SAVES)
        _refuse_out_of_bounds(self)


@dataclass(frozen=True)
class EvalConfig:
    """What `landtool eval` can be told besides the settings of `landtool track`; in a TOML its table is [eval]."""

    # folder or file to evaluate with; kept numbers to compare with, and how much worse each may become
    dataset: Path | None = None
    baseline: Path | None = None
    tolerance: Path | None = None
    # which labelled pictures: auto: the first of test, val and train that holds any
    split: Literal["auto", "test", "val", "train", "all"] = "auto"
    # what is scored; pose and track follow every clip as `landtool track` does
    stages: tuple[str, ...] = EVAL_STAGES
    # use the drone's own poses of the clips that have them
    ego: bool = True
    # the network looks at every n-th frame of a clip
    every: int = 1
    # a false detection of this score and more is a false alarm
    alarm_conf: float = 0.5
    # outputs besides metrics.json: csv: metrics.csv and the errors frame by frame; video: the clips annotated
    save: tuple[str, ...] = EVAL_SAVES[:1]

    def __post_init__(self) -> None:
        _refuse_unknown_outputs(self.save, EVAL_SAVES)
        for stage in self.stages:
            if stage not in EVAL_STAGES:
                raise UsageError(f"unknown stage '{stage}'", hint=f"known: {', '.join(EVAL_STAGES)}")
        if not self.stages:
            raise UsageError("no stage to score", hint=f"known: {', '.join(EVAL_STAGES)}")
        if self.every < 1:
            raise UsageError(f"every = {self.every} is impossible", hint="give 1 or more")
        if not 0.0 <= self.alarm_conf <= 1.0:
            raise UsageError(f"alarm_conf = {self.alarm_conf:g} is impossible", hint="give 0 to 1")


@dataclass(frozen=True)
class DehazeCommandConfig:
    """Everything `landtool dehaze` can be told, except its inputs and its output."""

    # auto: frames that are hazy enough (`haze_on`, `haze_off`); on: every frame
    when: Literal["auto", "on"] = "auto"
    # write the input's picture to the left of the output's, twice as wide
    side_by_side: bool = False
    # write the transmission of each dehazed frame beside the output, as PNGs of 16 bits, 65535 for 1
    save_transmission: bool = False
    # image topic of an MCAP log; frame rate of a folder of images
    topic: str | None = None
    fps: float | None = None
    dehazer: DehazeConfig = field(default_factory=DehazeConfig)

    def __post_init__(self) -> None:
        _refuse_out_of_bounds(self)


@dataclass(frozen=True)
class GenerateConfig:
    """Everything `landtool generate images` can be told, except its output folder. What is missing has no default."""

    # pictures to make
    n: int | None = None
    # another seed makes other pictures; picture i of a seed is the same whatever n is
    seed: int = 0
    # width and height of the pictures, pixels
    size: tuple[int, int] = (640, 480)
    # shares of train, val and, if there are three, test
    split: tuple[float, ...] = (0.8, 0.1, 0.1)
    # pad TOML, and a ring diameter that replaces its own, metres
    pad: Path | None = None
    diameter_m: float | None = None
    # folders of photographs to lay under the pad, or "scikit-image" for those of that package
    backgrounds: tuple[str, ...] = ()
    # processes that draw; none: one a core
    jobs: int | None = None
    # for each picture in fog draw the same in clear air, without noise, too
    clear: bool = False
    # draw the contact sheet and the statistics, too
    preview: bool = True
    # what the pictures vary in
    domain: Domain = field(default_factory=Domain)

    def __post_init__(self) -> None:
        _refuse_out_of_bounds(self)
        if self.jobs is not None and self.jobs < 1:
            raise UsageError(f"{self.jobs} jobs cannot work", hint="give 1 or more")


def _refuse_unknown_outputs(names: tuple[str, ...], known: tuple[str, ...]) -> None:
    for name in names:
        if name not in known:
            raise UsageError(f"unknown output '{name}'", hint=f"known: {', '.join(known)}")


def _refuse_out_of_bounds(settings: Any) -> None:
    for name, (low, high) in BOUNDS.items():
        value = getattr(settings, name, None)
        if value is not None and not low <= value <= high:
            raise UsageError(f"{name} = {value:g} is impossible", hint=f"give {low:g} to {high:g}")


# Settings that name files, each with its table
_FILES = (
    *(("", name) for name in ("camera", "pad", "mount", "ego", "cfg", "weights")),
    ("detector", "model"),
    *(("eval", name) for name in ("dataset", "baseline", "tolerance")),
)


def read_config(path: Path) -> dict[str, Any]:
    """Return the settings of a TOML file as nested values for `configured`; file names relative to it are resolved.

    Raises UsageError when it cannot be opened, InputError for broken TOML.
    """
    try:
        with local_file(path).open("rb") as file:
            data = tomllib.load(file)
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=path) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"no valid TOML: {error}", file=path) from error
    for table, key in _FILES:
        values = data.get(table, {}) if table else data
        value = values.get(key) if isinstance(values, dict) else None
        beside = path.parent / value if isinstance(value, str) else None
        # a baseline that is yet to be written belongs beside the file that names it
        if beside is not None and (beside.exists() or (key == "baseline" and value and not Path(value).exists())):
            values[key] = str(beside)
    places = data.get("backgrounds")
    if isinstance(places, list):
        here = path.parent
        data["backgrounds"] = [str(here / p) if isinstance(p, str) and (here / p).exists() else p for p in places]
    return data


def configured(base: Settings, values: Mapping[str, Any], where: str = "") -> Settings:
    """Return the settings with `values` put in; a nested mapping goes into the settings of that name.

    Raises InputError for a key that is not known, naming the nearest one, and for a value of the wrong type.
    """
    names = [f.name for f in fields(base)]  # type: ignore[arg-type]
    refuse_unknown_keys(values, names, where)
    hints = typing.get_type_hints(type(base))
    changes: dict[str, Any] = {}
    for key, value in values.items():
        current = getattr(base, key)
        if is_dataclass(current) and not isinstance(current, type):
            if not isinstance(value, Mapping):
                raise InputError(f"'{where}{key}' must be a table")
            changes[key] = configured(current, value, f"{where}{key}.")
        else:
            changes[key] = _converted(value, hints[key], f"{where}{key}")
    return replace(base, **changes)  # type: ignore[type-var]


def _converted(value: Any, kind: Any, name: str) -> Any:
    """Return a value as the type a field is declared with."""
    options = [k for k in get_args(kind) if k is not NoneType] if NoneType in get_args(kind) else [kind]
    wanted = options[0]
    if value == "":  # what an unset shell variable gives; as a path it would be the current folder
        raise InputError(f"'{name}' is empty", hint="leave it out or give a value")
    if get_origin(wanted) is Literal:
        if value in get_args(wanted):
            return value
        raise InputError(f"'{name}' must be one of {', '.join(map(str, get_args(wanted)))}")
    if get_origin(wanted) is tuple:
        return _converted_list(value, get_args(wanted), name)
    if wanted is Path and isinstance(value, str | Path):
        return Path(value)
    if wanted is float and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if isinstance(value, wanted) and not (wanted is int and isinstance(value, bool)):
        return value
    raise InputError(f"'{name}' must be {_KINDS.get(wanted, wanted.__name__)}, not {value!r}")


def _converted_list(value: Any, kinds: tuple[Any, ...], name: str) -> tuple[Any, ...]:
    """Return a list as the tuple a field is declared with: of names, of numbers, or a pair of numbers."""
    kind, count = kinds[0], None if kinds[-1] is ... else len(kinds)
    if kind is str:
        items = value.split(",") if isinstance(value, str) else value
        if isinstance(items, list | tuple) and all(isinstance(item, str) for item in items):
            return tuple(item.strip() for item in items)
        raise InputError(f"'{name}' must be a list of names")
    numbers = isinstance(value, list | tuple) and all(type(item) is kind or type(item) is int for item in value)
    if not numbers or (count is not None and len(value) != count):
        wanted = "whole numbers" if kind is int else "numbers"
        raise InputError(f"'{name}' must be a list of {'' if count is None else f'{count} '}{wanted}, not {value!r}")
    return tuple(kind(item) for item in value)


_KINDS = {float: "a number", int: "a whole number", str: "a text", bool: "true or false", Path: "a file name"}
