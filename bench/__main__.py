"""Print the tables behind landtool's numbers: `python -m bench [PART...]`, all parts without a name."""

from __future__ import annotations

import importlib
import os
import sys

# Each part: its module, with a function `main()` that prints tables, and what they show
PARTS = {
    "tags": ("bench.tags", "reading rate, corner error and time of the tag reader against two AprilTag bindings"),
    "track": ("bench.track", "pose by distance, mirror poses, time a frame, memory"),
    "generate": ("bench.generate", "images a second, memory, where the time goes, corner truth, correlations"),
    "detect": (
        "bench.detect",
        "the detector on path-traced and own pictures, in fog, and its time against the bare network",
    ),
    "ring": ("bench.ring", "the ring's ellipse against truth"),
    "print": ("bench.print_fit", "the whole print of small pads against truth"),
    "tone": (
        "bench.tone",
        "the gauge of the tone curve against known curves, and range errors by right and wrong ones",
    ),
    "dehaze": (
        "bench.dehaze",
        "dehazing against clear twins, the haze told, time, flicker, and the detector through fog",
    ),
    "predict": ("bench.predict", "predictions of the platform's place against truth, and their covariances"),
    "method": (
        "bench.method",
        "the whole of landtool track against truth: poses by distance, against tags, honest covariances, predictions",
    ),
    "speed": ("bench.speed", "frames a second of the whole of landtool track, near and far, and its stages"),
    "eval": ("bench.eval", "time of the metric code of boxes against the network's"),
    "report": ("bench.report", "time and size of the page of a run of a minute, and of ten"),
    "calibrate": ("bench.calibrate", "cameras from rendered boards against truth, their uncertainties, corners, time"),
    "recordings": ("bench.recordings", "landtool track on the real and path-traced recordings beside the project"),
}


def main(names: list[str]) -> int:
    """Run the named parts, or all."""
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        print(f"unknown part {unknown[0]}; known: {', '.join(PARTS)}", file=sys.stderr)
        return 2
    # as `landtool` has it: matrices here are small, and threads that wait for each other count as processor time
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for name in names or PARTS:
        module, text = PARTS[name]
        print(f"\n=== {name}: {text}", flush=True)
        importlib.import_module(module).main()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
