"""A picture through fog and the same one in clear air: what a dehazer is measured by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from landtool.pad import PadSpec
from landtool.synth.domain import Domain
from landtool.synth.fog import Fog
from landtool.synth.photograph import clear_twin, light_of, random_sensor
from landtool.synth.random_scene import draw_scene
from landtool.types import Image

Map = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class FogPair:
    """foggy: (H, W, 3) BGR uint8, with the sensor's noise. clear: the same scene, light and camera without both.

    transmission: (H, W) t of each sight line, 0 where it meets nothing. distance_m: to what the median pixel sees.
    """

    foggy: Image
    clear: Image
    transmission: Map
    fog: Fog
    distance_m: float

    @property
    def haze(self) -> float:
        """The share of the scene's light that the median pixel has lost, 1 - t."""
        return 1.0 - float(np.median(self.transmission))


def make_fog_pair(
    domain: Domain, pad: PadSpec, size: tuple[int, int], seed: int, index: int, photos: Sequence[Path] = ()
) -> FogPair | None:
    """Return pair `index` of a seed, None where that scene is in clear air. The same in any process.

    size: (width, height) in pixels. Not every pad can be made out in its fog, nor is there one in every picture.

    Raises UsageError as `draw_scene`.
    """
    rng = np.random.default_rng([seed, index])
    drawn = draw_scene(domain, pad, size, photos, rng)
    fog = drawn.scene.fog
    if fog is None:
        return None
    linear, rendered = light_of(drawn.scene, drawn.view)
    eye = drawn.view.world_T_camera.translation
    t = fog.transmission(rendered.distance_m, rendered.x_m, rendered.y_m, (float(eye[0]), float(eye[1])))
    sensor = random_sensor(domain, rng)
    distance_m = float(np.median(rendered.distance_m))
    clear = clear_twin(drawn.scene, drawn.view, sensor)
    return FogPair(sensor.picture(linear, rng), clear, t, fog, distance_m)
