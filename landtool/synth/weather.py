"""The light and the air of a picture, drawn at random."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landtool.synth.domain import Domain, chance, log_uniform, uniform
from landtool.synth.fog import KOSCHMIEDER, Fog
from landtool.synth.mesh import Albedo
from landtool.synth.scene import Sun

# linear light, blue first, of brightness about 1: the sun high and low, the blue sky and a grey one
_HIGH_SUN, _LOW_SUN = np.array([0.86, 1.0, 1.06]), np.array([0.38, 0.92, 1.45])
_BLUE_SKY, _GREY_SKY = np.array([1.45, 1.02, 0.80]), np.array([1.06, 1.0, 0.97])
# elevation below which the light of the sun turns to that of the evening
_EVENING_DEG = 25.0
# airlight of endless fog as a share of white under the same sky
_AIRLIGHT = (0.15, 0.9)
# beside the pad's distance: 5 % of its contrast get through
_LEAST_VISIBILITY = KOSCHMIEDER / 3.0


@dataclass(frozen=True)
class Weather:
    """sun: light and sky. level: brightness of a white level surface in the picture, 1 saturates. kind: its name."""

    sun: Sun
    level: float
    kind: str


def random_weather(domain: Domain, rng: np.random.Generator) -> Weather:
    """Return the light of a day, scaled to how bright the picture is to be."""
    elevation = math.radians(uniform(rng, domain.sun_elevation_deg))
    azimuth = float(rng.uniform(-math.pi, math.pi))
    level = log_uniform(rng, domain.light)
    overcast = chance(rng, domain.overcast)
    flat = math.cos(elevation)
    direction = (flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation))
    low = max(0.0, 1.0 - math.degrees(elevation) / _EVENING_DEG)
    sun_color = _HIGH_SUN + low * (_LOW_SUN - _HIGH_SUN)
    veil = float(rng.uniform(0.0, 0.6)) ** 2
    sky_color = _BLUE_SKY + (1.0 if overcast else veil) * (_GREY_SKY - _BLUE_SKY)
    if overcast:
        return Weather(Sun(direction, (0.0, 0.0, 0.0), _color(level * _GREY_SKY), 0.2), level, "overcast")
    # the sky gives from an eighth to a half of the light of a level surface; with a low sun it gives most
    share = float(np.clip(rng.uniform(0.12, 0.38) + veil * 0.3 + 0.35 * low, 0.0, 0.9))
    softness = 0.012 + 0.12 * veil
    sun = (1.0 - share) * level / max(math.sin(elevation), 0.05)
    kind = "evening" if low > 0.5 else "clear"
    return Weather(Sun(direction, _color(sun * sun_color), _color(share * level * sky_color), softness), level, kind)


def random_fog(domain: Domain, weather: Weather, distance_m: float, rng: np.random.Generator) -> Fog | None:
    """Return the fog of a picture, or clear air; its airlight is grey and darker than white under that sky.

    distance_m: of the pad. The fog is never so thick that nothing of the pad is left to be seen.

    Droplets throw the light of the sky on in its own direction (the mean cosine is about 0.85), so a camera that looks
    down gets little of it back: 0.15 to 0.45 of white in 8 pictures path-traced through a volume of fog. Haze seen at
    a slant comes nearer to white, hence the long tail: the median is 0.34.
    """
    if not chance(rng, domain.fog):
        return None
    tint = 1.0 + rng.normal(0.0, 0.04, 3) + np.array([0.02, 0.0, -0.01])
    low, high = _AIRLIGHT
    light = min(weather.level * (low + (high - low) * float(rng.random()) ** 2), 0.98)
    banks = float(rng.uniform(0.2, 0.9)) if chance(rng, domain.fog_banks) else 0.0
    return Fog.of_visibility(
        max(log_uniform(rng, domain.visibility_m), _LEAST_VISIBILITY * distance_m),
        _color(light * tint),
        bank_strength=banks,
        bank_scale_m=float(rng.uniform(4.0, 40.0)),
        bank_seed=int(rng.integers(8)),
    )


def _color(values: np.ndarray) -> Albedo:
    b, g, r = (float(max(v, 0.0)) for v in values)
    return (b, g, r)
