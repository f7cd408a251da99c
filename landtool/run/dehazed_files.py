"""Where dehazed recordings go: of each input's own kind, checked before any work."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from landtool.errors import LandtoolError, OutputExistsError, UsageError
from landtool.io.atomic import refuse_input_as_output
from landtool.io.image_out import IMAGE_FORMATS
from landtool.io.source import SourceKind, kind_of
from landtool.io.video_out import VIDEO_FORMATS

# The endings each kind of recording can be written with, the usual one first
ENDINGS: dict[SourceKind, tuple[str, ...]] = {
    "images": tuple(IMAGE_FORMATS),
    "video": tuple(VIDEO_FORMATS),
    "mcap": (".mcap",),
}
_NAMES: dict[SourceKind, str] = {"images": "an image", "video": "a video", "mcap": "an MCAP log"}


def dehazed_paths(inputs: Sequence[Path], output: Path, *, overwrite: bool, maps: bool = False) -> list[Path]:
    """Return what each input's result is called: `output`, or a name in it for several inputs or an existing folder.

    In a folder an input keeps its name; where its ending cannot be written it gets the usual one of its kind.
    maps: transmissions are written, too. Raises UsageError when an output is of another kind than its input, is an
    input, or two share one, OutputExistsError for one that is there, before any work.
    """
    if len(inputs) > 1 and output.exists() and not output.is_dir():
        raise UsageError("is no folder, and there are several inputs", file=output, hint="choose another -o")
    inside = len(inputs) > 1 or (output.is_dir() and not inputs[0].is_dir())
    paths = [_in_folder(path, output) if inside else output for path in inputs]
    if not inside:
        refuse_other_kind(inputs[0], output)
    taken: dict[Path, Path] = {}
    for source, path in zip(inputs, paths, strict=True):
        for target in (path, map_folder(source, path)) if maps else (path,):
            refuse_input_as_output(inputs, target)
            if target in taken:
                raise UsageError(
                    f"would write the same as {taken[target]}: {target}", file=source, hint="run them apart"
                )
            taken[target] = source
            if not overwrite and _is_there(target, folder=target != path or source.is_dir()):
                raise OutputExistsError(target)
    return paths


def map_folder(source: Path, output: Path) -> Path:
    """Return the folder beside an output in which its transmission maps are."""
    return output.with_name(f"{output.name if source.is_dir() else output.stem}-transmission")


def refuse_other_kind(source: Path, output: Path) -> None:
    """Raise UsageError unless an output's ending is one for the kind its input is of."""
    known = ENDINGS[kind_of(source)]
    if source.is_dir():
        if any(output.suffix.lower() in endings for endings in ENDINGS.values()) and not output.is_dir():
            reason = "is the name of a file, and a folder of images becomes a folder"
            raise UsageError(reason, file=output, hint="name a folder with -o")
    elif output.suffix.lower() not in known:
        ending = f"the ending '{output.suffix}'" if output.suffix else "a name without an ending"
        reason = f"{_NAMES[kind_of(source)]} cannot be written to {ending}"
        raise UsageError(reason, file=output, hint=f"use one of {' '.join(known)}")


def _in_folder(source: Path, folder: Path) -> Path:
    # made absolute for the names of `.` and `..`; a link keeps its own name
    path = folder / (Path(os.path.abspath(source)).name or "root")  # noqa: PTH100
    try:
        endings = ENDINGS[kind_of(source)]
    except LandtoolError:  # its own run says so, the other inputs have theirs
        return path
    return path if source.is_dir() or path.suffix.lower() in endings else path.with_suffix(endings[0])


def _is_there(target: Path, *, folder: bool) -> bool:
    return os.path.lexists(target) and not (folder and target.is_dir() and not any(target.iterdir()))
