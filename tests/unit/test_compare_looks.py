"""The statistics of tools/compare_looks.py measure what their names say."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
import pytest

from tests.shared import ROOT


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("compare_looks", ROOT / "tools" / "compare_looks.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _squares(blur_px: float = 0.0, noise: float = 0.0) -> np.ndarray:
    """Dark and light squares of 60 pixels."""
    rng = np.random.default_rng(0)
    light = 80.0 + 100.0 * (np.add.outer(np.arange(480) // 60, np.arange(640) // 60) % 2)
    light = cv2.GaussianBlur(light, (0, 0), blur_px) if blur_px else light
    grey = np.clip(np.round(light + rng.normal(0.0, noise, light.shape)), 0, 255).astype(np.uint8)
    return np.repeat(grey[:, :, None], 3, axis=2)


@pytest.mark.parametrize("noise", [1.0, 3.0, 8.0])
def test_noise_is_found_beside_edges(tool: ModuleType, noise: float) -> None:
    found = tool.statistics(_squares(1.0, noise))["noise, grey levels"]
    assert found == pytest.approx(noise, rel=0.15)


def test_edges_get_wider_with_blur(tool: ModuleType) -> None:
    widths = [tool.statistics(_squares(blur))["edge width, px"] for blur in (0.5, 1.0, 2.0)]
    # a step blurred by sigma has the slope height / (sigma sqrt(2 pi)); Sobel's own smoothing adds to small sigmas
    assert widths[0] < widths[1] < widths[2]
    assert widths[2] == pytest.approx(2.0 * np.sqrt(2.0 * np.pi), rel=0.15)


def test_brightness_contrast_and_clipping(tool: ModuleType) -> None:
    plain = tool.statistics(_squares())
    assert plain["luminance mean, 0-255"] == pytest.approx(130.0, abs=4.0)
    assert plain["contrast (std)"] == pytest.approx(50.0, abs=1.0)
    assert plain["saturation, 0-1"] == 0.0
    half_white = np.zeros((480, 640, 3), np.uint8)
    half_white[:120] = 255
    clipped = tool.statistics(half_white)
    assert clipped["white clipped, %"] == pytest.approx(25.0)
    assert clipped["black clipped, %"] == pytest.approx(75.0)


def test_sheet_and_table_have_every_set(tool: ModuleType, tmp_path: Path) -> None:
    for name, count in (("ours", 3), ("theirs", 7)):
        (tmp_path / name).mkdir()
        for i in range(count):
            cv2.imwrite(str(tmp_path / name / f"{i}.png"), _squares(noise=float(i)))
    text = tool.compare(tmp_path / "ours", tmp_path / "out.png", [tmp_path / "theirs"])
    lines = text.splitlines()
    assert lines[0].endswith("ours, 3 pictures")
    assert lines[1].endswith("theirs, 7 pictures")
    assert len(lines) == 3 + len(tool.STATISTICS)
    sheet = cv2.imread(str(tmp_path / "out.png"))
    assert sheet is not None
    width, height = tool.CELL
    assert sheet.shape[0] == 2 * height + 2  # seven pictures need a second row
    assert sheet.shape[1] == 2 * (tool.SIDE_BY * (width + 2) - 2) + 12
