"""What the settings say of haze, as a part of a run."""

from __future__ import annotations

from typing import Literal

from landtool.dehaze.config import DehazeConfig
from landtool.dehaze.stage import DehazeStage


def dehaze_stage(when: Literal["auto", "on", "off"], config: DehazeConfig) -> DehazeStage | None:
    """Return the stage that dehazes the frames of one recording, None when it is off."""
    return None if when == "off" else DehazeStage(config, when=when)
