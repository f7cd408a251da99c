"""Every number of an evaluation is explained on its page."""

from __future__ import annotations

import re

import pytest

from landtool.evaluate.baseline import read_baseline
from landtool.evaluate.words import HEADLINES
from tests.shared import ROOT

PAGE = (ROOT / "docs" / "eval.md").read_text(encoding="utf-8")
METRICS = read_baseline(ROOT / "datasets" / "baseline.json").metrics
NAMES = sorted({(m.stage, m.name) for m in METRICS if m.stage != "speed"})


@pytest.mark.parametrize(("stage", "name"), NAMES)
def test_its_name_stands_there(stage: str, name: str) -> None:
    any_horizon = re.sub(r"_[\d.]+_s_", "_H_s_", name)
    assert re.search(rf"\b{re.escape(any_horizon)}\b", PAGE), f"{stage}.{name}"


def test_main_numbers_are_numbers_of_an_evaluation() -> None:
    assert {headline.key for headline in HEADLINES} <= {metric.key for metric in METRICS}
