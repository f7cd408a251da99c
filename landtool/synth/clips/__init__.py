"""Clips of landings on moving platforms, with the exact truth of every frame."""

from landtool.synth.clips.config import BOUNDS, ClipConfig
from landtool.synth.clips.scenarios import SCENARIOS, ScenarioName
from landtool.synth.clips.write import SIDE_FILES, ClipReport, Progress, side_files, write_clip

__all__ = [
    "BOUNDS",
    "SCENARIOS",
    "SIDE_FILES",
    "ClipConfig",
    "ClipReport",
    "Progress",
    "ScenarioName",
    "side_files",
    "write_clip",
]
