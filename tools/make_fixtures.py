"""Make datasets/fixtures: clips of every scenario and a small dataset of stills, with truth. Run: `make fixtures`."""

from __future__ import annotations

import shutil
import tempfile
from fractions import Fraction
from pathlib import Path

import cv2

from landtool.pad import PadSpec
from landtool.synth.board_clip import BoardClipConfig, write_board_clip
from landtool.synth.clips import ClipConfig, write_clip
from landtool.synth.dataset import DatasetRequest, write_dataset
from landtool.synth.domain import Domain

FIXTURES = Path(__file__).parent.parent / "datasets" / "fixtures"
SMALL = (400, 300)
SLOW = Fraction(20)
APPROACH = ClipConfig("turn", duration_s=4.0, height_start_m=6.0, seed=3, mcap_schema="foxglove")
CLIPS = {
    "straight": ClipConfig("straight", 3.0, SLOW, SMALL, 4.0, seed=11),
    "stop-and-go": ClipConfig("stop-and-go", 4.0, SLOW, SMALL, 5.0, vfr=True, seed=12),
    "figure-eight": ClipConfig("figure-eight", 3.0, SLOW, SMALL, 3.5, seed=13),
    "heave": ClipConfig("heave", 3.0, SLOW, SMALL, 3.5, wind_mps=4.0, seed=14),
    "hover-fog": ClipConfig("hover", 4.0, SLOW, SMALL, 3.5, fog_beta=0.15, seed=15),
    # near enough that the tag is read before the bridge hides it
    "occlusion": ClipConfig("occlusion", 4.0, SLOW, SMALL, 4.2, hfov_deg=60.0, seed=22),
}
BOARD = BoardClipConfig(seed=7)
STILLS = DatasetRequest(40, 5, SMALL, (0.5, 0.25, 0.25), Domain(jpeg_quality=(60.0, 90.0)), PadSpec(), clear=True)


def main() -> None:
    """Write every fixture, replacing the old ones."""
    cv2.setNumThreads(1)
    FIXTURES.mkdir(parents=True, exist_ok=True)
    for path in make(FIXTURES):
        print(path.relative_to(FIXTURES.parent))


def make(folder: Path) -> list[Path]:
    """Write every fixture into a folder; returns the clips and the dataset."""
    made = [write_clip(APPROACH, folder / "approach.mp4", overwrite=True).path, _as_log(APPROACH, folder)]
    made += [write_clip(config, folder / f"{name}.mp4", overwrite=True).path for name, config in CLIPS.items()]
    write_board_clip(BOARD, folder / "board.mp4", overwrite=True)
    write_dataset(STILLS, folder / "stills", overwrite=True, preview=False)
    return [*made, folder / "board.mp4", folder / "stills"]


def _as_log(config: ClipConfig, folder: Path) -> Path:
    """Write the same landing as an MCAP log; the files beside the video are its files, too."""
    with tempfile.TemporaryDirectory() as scratch:
        log = write_clip(config, Path(scratch) / "approach.mcap").path
        return Path(shutil.copy(log, folder / "approach.mcap"))


if __name__ == "__main__":
    main()
