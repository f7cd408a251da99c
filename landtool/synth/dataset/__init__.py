"""Datasets of generated pictures: what is asked for, who draws it, what is written."""

from landtool.synth.dataset.request import DatasetRequest
from landtool.synth.dataset.rows import TRUTH_COLUMNS
from landtool.synth.dataset.write import DatasetSummary, Progress, write_dataset

__all__ = ["TRUTH_COLUMNS", "DatasetRequest", "DatasetSummary", "Progress", "write_dataset"]
