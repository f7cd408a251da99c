"""Writes a dataset: pictures, labels, truth and the manifest; whole, or kept aside to go on with."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from landtool.camera import Camera
from landtool.errors import UsageError
from landtool.io.atomic import TEMPORARY_PREFIX, refuse_input_as_output, resumable_folder
from landtool.io.calibration import camera_yaml
from landtool.io.coco import write_coco
from landtool.io.labels import LabelledImage, data_yaml, label_path, yolo_rows
from landtool.io.run_record import sha256_of
from landtool.io.tables import format_cell
from landtool.synth.dataset.request import DatasetRequest
from landtool.synth.dataset.rows import TRUTH_COLUMNS, boxes_of
from landtool.synth.dataset.work import CLEAR, Draw, Work, draw_images

MANIFEST = "manifest.json"
CLASS_NAMES = ("pad",)
# what `landtool generate preview` adds to a dataset made without
SHEETS = ("preview.png", "statistics.png")


@dataclass(frozen=True)
class DatasetSummary:
    """What was made.

    kept: pictures an earlier run had made. with_pad: pictures with a label. splits: their sizes. twins: pictures of
    clear air that belong to those in fog.
    """

    folder: Path
    images: int
    kept: int
    with_pad: int
    splits: dict[str, int]
    twins: int = 0


@dataclass(frozen=True)
class Progress:
    """Told how the work goes. start: pictures in all, and those an earlier run made; images: so many more are done."""

    start: Callable[[int, int], None] = lambda _total, _kept: None
    images: Callable[[int], None] = lambda _count: None


def write_dataset(
    request: DatasetRequest,
    folder: Path,
    *,
    jobs: int = 1,
    overwrite: bool = False,
    preview: bool = True,
    progress: Progress | None = None,
    draw: Draw | None = None,
) -> DatasetSummary:
    """Make a dataset in `folder` with `jobs` processes; its bytes do not depend on their number.

    An interrupted run leaves `folder` as it was and its pictures in a hidden folder beside it, from which the same
    request goes on to the same bytes. preview: also draw the contact sheet and the statistics. draw: what draws a
    picture, by default `landtool.synth.make_sample.make_sample`.

    Raises UsageError for jobs below 1 and for a place that is taken or holds other files than a dataset's,
    OutputError when it cannot be written, and what drawing raises.
    """
    if jobs < 1:
        raise UsageError(f"{jobs} jobs cannot work", hint="give 1 or more")
    progress = progress or Progress()
    refuse_input_as_output(request.photo_paths, folder)
    refuse_foreign_files(folder)
    text = f"{request.as_text()} preview={preview}"
    with resumable_folder(folder, text, overwrite=overwrite, mark=MANIFEST) as place:
        for half in place.whole.rglob(f"{TEMPORARY_PREFIX}*"):  # of a run that was killed while it wrote the tables
            half.unlink()
        work = Work(request, request.split_of_images(), place, draw or _draw())
        for name in request.splits:
            (place.whole / "images" / name).mkdir(parents=True, exist_ok=True)
        left = [index for index in range(request.n) if not work.is_done(index)]
        progress.start(request.n, request.n - len(left))
        draw_images(work, left, jobs, progress.images)
        with_pad = _write_tables(work)
        if preview:
            _write_preview(place.whole)
        _write_manifest(work)
    splits = {name: sum(split == name for split in work.split_of) for name in request.splits}
    twins = sum(1 for _ in folder.glob(f"{CLEAR}/*/*.jpg"))
    return DatasetSummary(folder, request.n, request.n - len(left), with_pad, splits, twins)


def refuse_foreign_files(folder: Path) -> None:
    """Raise UsageError when a dataset's folder holds a file that is not of the dataset: `--overwrite` would lose it."""
    try:
        own = json.loads((folder / MANIFEST).read_bytes())["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return  # no dataset: `resumable_folder` says so
    known = {MANIFEST, *SHEETS, *own}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if not path.is_dir() and name not in known:
            hint = "move it away or choose another -o"
            raise UsageError(f"holds {name}, which is not of the dataset", file=folder, hint=hint)


def _draw() -> Draw:
    from landtool.synth.make_sample import make_sample

    return make_sample


def _write_preview(folder: Path) -> None:
    from landtool.synth.preview import write_preview  # loads matplotlib

    write_preview(folder, overwrite=True)


def _write_tables(work: Work) -> int:
    """Write everything that follows from what is true of the pictures; return how many have a label."""
    whole, request = work.place.whole, work.request
    width, height = request.size
    (whole / "annotations").mkdir(exist_ok=True)
    with_pad = 0
    with (whole / "truth.csv").open("w", encoding="utf-8", newline="") as table:
        table.write(",".join(TRUTH_COLUMNS) + "\n")
        for row in map(work.row, range(request.n)):
            table.write(",".join(format_cell(row[name]) for name in TRUTH_COLUMNS) + "\n")
            boxes = boxes_of(row)
            with_pad += bool(boxes)
            labels = label_path(whole / str(row["file"]))
            labels.parent.mkdir(parents=True, exist_ok=True)
            labels.write_text(yolo_rows(boxes, width, height), encoding="utf-8", newline="\n")
    for name in request.splits:
        write_coco(whole / "annotations" / f"{name}.json", CLASS_NAMES, partial(_labelled, work, name))
    lines = data_yaml(CLASS_NAMES, request.splits)
    (whole / "data.yaml").write_text(lines, encoding="utf-8", newline="\n")
    (whole / "pad.toml").write_text(request.pad.to_toml(), encoding="utf-8", newline="\n")
    (whole / "camera.yaml").write_text(camera_yaml(nominal_camera(request)), encoding="utf-8", newline="\n")
    return with_pad


def nominal_camera(request: DatasetRequest) -> Camera:
    """Return the camera in the middle of the range of fields of view, without distortion; `assumed` says so."""
    low, high = request.domain.hfov_deg
    return Camera.from_hfov(*request.size, (low + high) / 2.0)


def _labelled(work: Work, split: str) -> Iterator[LabelledImage]:
    """Yield the pictures of a split as COCO names them: relative to the dataset."""
    for index, name in enumerate(work.split_of):
        if name == split:
            yield LabelledImage(Path(work.image(index)), *work.request.size, boxes_of(work.row(index)))


def _write_manifest(work: Work) -> None:
    """Write what was asked for and the digest of every file."""
    whole = work.place.whole
    files = sorted(path for path in whole.rglob("*") if path.is_file() and path.name != MANIFEST)
    digests = {path.relative_to(whole).as_posix(): sha256_of(path) for path in files}
    values = {**work.request.as_values(), "files": digests}
    (whole / MANIFEST).write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8", newline="\n")
