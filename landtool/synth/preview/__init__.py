"""Looking at a generated data set: its pictures with their labels, and what was drawn how often."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from landtool.errors import UsageError
from landtool.io.atomic import atomic_path
from landtool.synth.preview.correlation import Correlation, correlations
from landtool.synth.preview.facts import TRUTH, measure_brightness, read_facts
from landtool.synth.preview.labels import labelled, read_labels
from landtool.synth.preview.sheet import contact_sheet, evenly
from landtool.synth.preview.statistics import draw_statistics, truth_correlations

__all__ = ["Correlation", "correlations", "dataset_correlations", "write_preview"]

COLUMNS = 10
CELL_PX = (320, 240)
MAX_COUNT = 1000  # a sheet of more would be larger than what shows pictures can open


def write_preview(
    dataset: Path, output: Path | None = None, *, count: int = 60, overwrite: bool = False
) -> tuple[Path, Path]:
    """Write preview.png and statistics.png of a data set to the folder `output`, default the data set's own.

    preview.png: `count` evenly chosen pictures with their labels drawn. statistics.png: histograms over all pictures,
    and what correlates with the pad's size. Same data set, same bytes.

    Raises UsageError for a folder without truth.csv and an impossible count, InputError for a broken one,
    OutputExistsError, OutputError.
    """
    if not 1 <= count <= MAX_COUNT:
        raise UsageError(f"a preview of {count} pictures is impossible", hint=f"give 1 to {MAX_COUNT}")
    if not (dataset / TRUTH).is_file():
        hint = "name a folder that `landtool generate images` wrote"
        raise UsageError(f"is no generated dataset: it has no {TRUTH}", file=dataset, hint=hint)
    folder = dataset if output is None else output
    preview, statistics = folder / "preview.png", folder / "statistics.png"
    # both files are reserved before the work, and appear together
    with (
        atomic_path(preview, overwrite=overwrite) as preview_file,
        atomic_path(statistics, overwrite=overwrite) as statistics_file,
    ):
        facts = read_facts(dataset)
        chosen = evenly(len(facts), count)
        labels = read_labels(dataset, facts.files)
        pictures = (labelled(labels[facts.files[i]], facts.tag_corners_px[i], *CELL_PX) for i in chosen)
        columns, rows = min(COLUMNS, len(chosen)), -(-len(chosen) // COLUMNS)
        sheet = contact_sheet(pictures, columns, rows, *CELL_PX)
        preview_file.write_bytes(np.asarray(cv2.imencode(".png", sheet)[1]).tobytes())
        statistics_file.write_bytes(draw_statistics(facts, measure_brightness(dataset, facts)))
    return preview, statistics


def dataset_correlations(dataset: Path) -> list[Correlation]:
    """Return what correlates with the pad's size in a data set, for a table. Errors as `write_preview`."""
    return truth_correlations(read_facts(dataset))
