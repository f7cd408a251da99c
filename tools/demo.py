"""Track the shipped landing and say what came out, against the clip's exact truth. Run: `make demo`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from landtool.io.tables import read_table

ROOT = Path(__file__).parent.parent
CLIP = ROOT / "datasets" / "fixtures" / "approach.mp4"
OUTPUT = ROOT / "runs" / "demo"


def main() -> int:
    """Run `landtool track` as a user would, then compare its tables with the truth."""
    command = [
        *(str(Path(sys.executable).parent / "landtool"), "track", str(CLIP.relative_to(ROOT))),
        *("--camera", str(CLIP.with_suffix(".camera.yaml").relative_to(ROOT))),
        *("--ego", str(CLIP.with_suffix(".ego.csv").relative_to(ROOT))),
        *("-o", str(OUTPUT.relative_to(ROOT)), "--overwrite"),
    ]
    print("$ landtool " + " ".join(command[1:]), flush=True)
    code = subprocess.run(command, cwd=ROOT, check=False).returncode
    if code:
        return code
    folder = OUTPUT / CLIP.stem
    for line in compared(folder, CLIP.with_suffix(".truth.csv")):
        print(f"  {line}")
    print(f"  watch {(folder / 'annotated.mp4').relative_to(ROOT)}; the tables lie beside it")
    return 0


def compared(folder: Path, truth_file: Path) -> list[str]:
    """Return the errors of a run's poses and tracks against the clip's truth, as text."""
    truth = read_table(truth_file, dict.fromkeys(["frame"], int) | dict.fromkeys(_PLACES, float))
    in_camera = np.column_stack([truth.floats(f"camera_T_pad_{c}_m") for c in "xyz"])
    in_world = np.column_stack([truth.floats(f"world_T_pad_{c}_m") for c in "xy"])
    poses = read_table(folder / "poses.csv")
    at = [frame or 0 for frame in poses.ints("frame")]
    measured = np.column_stack([poses.floats(f"{c}_m") for c in "xyz"])
    error = np.linalg.norm(measured - in_camera[at], axis=1) / np.linalg.norm(in_camera[at], axis=1)
    tracks = read_table(folder / "tracks.csv")
    held = np.array([state == "confirmed" for state in tracks.texts("state")])
    frames = np.array([frame or 0 for frame in tracks.ints("frame")])
    place = np.column_stack([tracks.floats("x_m"), tracks.floats("y_m")])
    off = np.linalg.norm(place - in_world[frames], axis=1)[held]
    later = frames + 15  # half a second at 30 frames a second
    known = held & (later < len(in_world))
    ahead = np.column_stack([tracks.floats("x_pred_m"), tracks.floats("y_pred_m")])
    missed = np.linalg.norm(ahead[known] - in_world[later[known]], axis=1)
    return [
        f"against the truth: pose error {100 * np.median(error):.3f} % of the distance (median of {len(at)})",
        f"track error {1e3 * _rms(off):.1f} mm RMS; half a second ahead {1e3 * _rms(missed):.0f} mm RMS",
    ]


_PLACES = [f"camera_T_pad_{c}_m" for c in "xyz"] + [f"world_T_pad_{c}_m" for c in "xy"]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


if __name__ == "__main__":
    sys.exit(main())
