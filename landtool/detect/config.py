"""How the detector is set, kept apart from it so that reading settings does not load ONNX Runtime."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from landtool.errors import UsageError

# What a number must lie in; the command line's options have the same
BOUNDS: dict[str, tuple[float, float]] = {
    "conf": (0.0, 1.0),
    "iou": (0.0, 1.0),
    "imgsz": (32, 8192),
    "threads": (1, 256),
    "max_boxes": (1, 100_000),
}


@dataclass(frozen=True)
class DetectorConfig:
    """Which network looks for boxes, and which of them count. Raises UsageError outside `BOUNDS`."""

    # an ONNX file; none: the network in the package
    model: Path | None = None
    # least score of a box
    conf: float = 0.25
    # of two boxes of one class that overlap by more than this (intersection over union) the better stays
    iou: float = 0.45
    # width and height of the network's input, pixels; none: what the model says
    imgsz: tuple[int, int] | None = None
    # threads of one inference; none: 1, which leaves the other cores to decoding and encoding (a second one gained
    # nothing on a machine whose two cores were busy)
    threads: int | None = None
    # how the network's output is to be read; none: found out
    layout: str | None = None
    # most boxes of one picture
    max_boxes: int = 300

    def __post_init__(self) -> None:
        for name, (low, high) in BOUNDS.items():
            value = getattr(self, name)
            for number in value if isinstance(value, tuple) else (value,):
                if number is not None and not low <= number <= high:
                    raise UsageError(f"{name} = {number:g} is impossible", hint=f"give {low:g} to {high:g}")
