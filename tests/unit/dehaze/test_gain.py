"""What dehazing gains on pairs of the generator: far less than this and something broke."""

from __future__ import annotations

import cv2
import numpy as np

from landtool.dehaze.config import DehazeConfig
from landtool.dehaze.stage import DehazeStage
from landtool.pad import PadSpec
from landtool.synth.domain import Domain
from landtool.synth.fog_pair import make_fog_pair
from landtool.types import Frame

FOG = Domain(height_m=(5.0, 20.0), fog=1.0, visibility_m=(10.0, 60.0))


def test_most_foggy_pictures_come_nearer_to_the_clear_ones() -> None:
    stage = DehazeStage(DehazeConfig(), when="on")
    gains, hazes = [], []
    for index in range(16):
        pair = make_fog_pair(FOG, PadSpec(), (320, 240), 77, index)
        assert pair is not None
        seen = stage.see(Frame(index, None, pair.foggy))
        gains.append(cv2.PSNR(seen.image, pair.clear) - cv2.PSNR(pair.foggy, pair.clear))
        hazes.append((seen.haze, pair.haze))
    print(f"gain {np.median(gains):+.2f} dB in the median, {np.mean(np.array(gains) > 0.0):.0%} better")
    assert np.median(gains) > 1.5
    assert np.mean(np.array(gains) > 0.0) >= 0.75
    said, true = np.array(hazes).T
    assert np.median(np.abs(said - true)) < 0.15
