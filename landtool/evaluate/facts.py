"""What is true of a picture besides its boxes, and the parts of the data that results are told for."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

# Bounds of the parts, by the fact they are about; the first part begins at the first bound, the last may be open
BOUNDS: dict[str, tuple[float, ...]] = {
    "distance_m": (0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 25.0, math.inf),
    "size_px": (0.0, 14.0, 20.0, 40.0, 100.0, 300.0, math.inf),
    "tilt_deg": (0.0, 5.0, 15.0, 30.0, 45.0, 90.0),
    "fog_per_m": (0.0, 1e-6, 0.05, 0.1, 0.2, math.inf),
    "shadow": (0.0, 0.01, 0.5, math.inf),
    "blur_px": (0.0, 1.0, 2.0, 4.0, math.inf),
    "visible": (0.0, 0.5, 0.99, math.inf),
    "tag_px": (0.0, 14.0, 20.0, 30.0, 50.0, 100.0, math.inf),
}


@dataclass(frozen=True)
class Facts:
    """What is known to be true of one picture and the pad in it; None is unknown.

    distance_m: of the pad's centre from the camera. size_px: longer side of its box. tilt_deg: between the pad's normal
    and the line of sight. fog_per_m: extinction, 0 in clear air. shadow: share of the pad in shadow. blur_px: of motion
    and lens together, standard deviation.
    """

    distance_m: float | None = None
    size_px: float | None = None
    tilt_deg: float | None = None
    fog_per_m: float | None = None
    shadow: float | None = None
    blur_px: float | None = None


def parts(fact: str, values: Sequence[float | None]) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Yield every part that values fall into: its name as `distance_m=2-4`, and which (N,) of the values do.

    An unknown value is in no part. Raises KeyError for a fact that BOUNDS does not name.
    """
    known = np.array([math.nan if value is None else value for value in values], np.float64)
    for low, high in pairwise(BOUNDS[fact]):
        inside = (known >= low) & (known < high)
        if inside.any():
            yield f"{fact}={_said(low, high)}", inside


def _said(low: float, high: float) -> str:
    if high == 1e-6:
        return "clear"
    return f"{0.0 if low == 1e-6 else low:g}-{'more' if math.isinf(high) else f'{high:g}'}"
