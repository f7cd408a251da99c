"""The gate sees every one of five ways in which a perception gets worse without anybody noticing."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from landtool.config import EvalConfig, TrackConfig, configured
from landtool.evaluate.gate import GateResult
from landtool.io import video
from landtool.run import scoring_stills
from landtool.run.evaluation import EvalRequest, evaluate
from landtool.tags.reader import TagReader
from landtool.types import Frame, Image, TagObservation
from tests.shared import ROOT

FIXTURES = ROOT / "datasets" / "fixtures"
HALF_A_PIXEL = 0.5
Patch = pytest.MonkeyPatch


def tags_half_a_pixel_off(patch: Patch) -> None:
    observe: Callable[..., TagObservation | None] = TagReader._observe

    def shifted(self: TagReader, *args: Any) -> TagObservation | None:
        tag = observe(self, *args)
        return None if tag is None else replace(tag, corners_px=tag.corners_px + HALF_A_PIXEL)

    patch.setattr(TagReader, "_observe", shifted)


def red_taken_for_blue(patch: Patch) -> None:
    def swapped(image: Image) -> Image:
        return np.ascontiguousarray(image[..., ::-1])

    def frame(index: int, t_ns: int | None, image: Image, **others: Any) -> Frame:
        return Frame(index, t_ns, swapped(image), **others)

    image_of = scoring_stills.image_of
    patch.setattr(video, "Frame", frame)
    patch.setattr(scoring_stills, "image_of", lambda path: swapped(image_of(path)))


def frame_rate_one_percent_off(patch: Patch) -> None:
    def frame(index: int, t_ns: int | None, image: Image, **others: Any) -> Frame:
        return Frame(index, None if t_ns is None else round(1.01 * t_ns), image, **others)

    patch.setattr(video, "Frame", frame)


def nothing(patch: Patch) -> None:
    """Leave the code as it is: the settings are what is wrong."""


@dataclass(frozen=True)
class Degradation:
    """What goes wrong, in code or settings, on which part of the fixtures it is tried, and what it spoils."""

    spoils: str
    part: str
    code: Callable[[Patch], None] = nothing
    settings: Mapping[str, Any] | None = None


DEGRADATIONS = {
    "a higher least score": Degradation("detection.recall", "stills", settings={"detector": {"conf": 0.8}}),
    "a lower least score": Degradation("detection.precision", "stills", settings={"detector": {"conf": 0.05}}),
    "tags half a pixel off": Degradation("tags.corner_px_median", "heave", tags_half_a_pixel_off),
    "a filter ten times as noisy": Degradation(
        "track.prediction_0.5_s_nees", "heave", settings={"tracker": {"accel_sigma_mps2": 10.0}}
    ),
    "red taken for blue": Degradation("detection.map50", "stills", red_taken_for_blue),
    "a frame rate one percent off": Degradation("time.rate_ppm", "heave", frame_rate_one_percent_off),
}
STAGES = {"stills": ("detection",), "heave": ("pose", "track")}


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> dict[str, EvalRequest]:
    """Two parts of the fixtures, each with the baseline of landtool as it is."""
    requests = {}
    for part, stages in STAGES.items():
        folder = tmp_path_factory.mktemp(part)
        data = folder / "data"
        data.mkdir()
        for file in FIXTURES.glob(f"{part}*"):
            (shutil.copytree if file.is_dir() else shutil.copy)(file, data / file.name)
        evaluation = EvalConfig(dataset=data, baseline=folder / "b.json", split="all", stages=stages, save=())
        requests[part] = EvalRequest(evaluation, TrackConfig(), folder / "out", overwrite=True)
        assert evaluate(replace(requests[part], update_baseline=True)).record.exit_code == 0
    return requests


def gate_of(request: EvalRequest, settings: Mapping[str, Any] | None = None) -> GateResult:
    """Evaluate with settings changed, and return what the gate says."""
    outcome = evaluate(replace(request, config=configured(TrackConfig(), settings or {})))
    assert outcome.gate is not None
    assert outcome.record.exit_code == (0 if outcome.gate.passed else 1)
    return outcome.gate


@pytest.mark.parametrize("part", STAGES)
def test_what_did_not_change_passes(kept: dict[str, EvalRequest], part: str) -> None:
    assert gate_of(kept[part]).passed


@pytest.mark.parametrize("name", DEGRADATIONS)
def test_the_gate_sees(name: str, kept: dict[str, EvalRequest], monkeypatch: Patch) -> None:
    wrong = DEGRADATIONS[name]
    wrong.code(monkeypatch)
    assert wrong.spoils in {row.key for row in gate_of(kept[wrong.part], wrong.settings).of("worse")}


@pytest.mark.full
@pytest.mark.parametrize("name", DEGRADATIONS)
def test_the_projects_own_baseline_sees(name: str, tmp_path: Path, monkeypatch: Patch) -> None:
    wrong = DEGRADATIONS[name]
    wrong.code(monkeypatch)
    evaluation = EvalConfig(dataset=FIXTURES, baseline=ROOT / "datasets" / "baseline.json", split="all", save=())
    # over all recordings a least score of 0.8 costs fewer targets than the tolerance, but foggy ones
    assert gate_of(EvalRequest(evaluation, TrackConfig(), tmp_path / "out"), wrong.settings).of("worse")
