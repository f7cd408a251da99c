"""The veil: haze as a camera that looks down sees it, one airlight and a transmission smooth over the ground.

From above the dark channel prior has no sky to take the airlight from, and takes it from the pad; its transmission
follows every object's edge. Here the air is seven numbers, found by a small regression from statistics of the picture
(how dark its dark parts are, how colourful, how contrasty) that was fitted on generated fog by `tools/fit_veil.py`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from landtool.dehaze.statistics import BRIGHT, DARK, MIDDLE, SHARES, Statistics
from landtool.tone import srgb_decode

Array = NDArray[np.float64]

OUTPUTS = 7
LEAST_TRANSMISSION = 0.08
VEIL_OF_DARK = 1.1  # a veil is at most this much brighter than what is darkest: averages hide the darkest
TINT = 0.2  # of the scaled outputs: what 1 means
SLOPE = 0.3
_LEAST_RISE, _MOST_RISE = 0.2, 5.0
# how far estimates of a still scene are from each other, of the veil relative to it
_STILL = 0.03
# how far what is smoothed may be behind
_BEHIND = 0.06
_LEAST_LOST, _LEAST_LIGHT = 1e-3, 1e-4
# contrast, of full scale, up to which a picture is even
_EVEN = 0.015
# how far the change of the middle light is believed, and its bounds
_TRUST, _LEAST_RATIO, _MOST_RATIO = 0.8, 0.1, 3.0


@dataclass(frozen=True, eq=False)
class Veil:
    """What lies before a picture. veil: (3,) light it adds in the middle, blue first, linear, 0 to 1.

    lost: share of the scene's light lost in the middle, 1 - t. slope: (2,) by how much the logarithm of both rises
    from the middle to the right and to the lower border. haze: the best guess of 1 - t, which is less cautious.
    """

    veil: Array
    lost: float
    slope: Array
    haze: float

    @property
    def airlight(self) -> Array:
        """A (3,): the light of endless air."""
        return np.asarray(self.veil / self.lost)

    def transmission(self, width: int, height: int) -> NDArray[np.float32]:
        """Return t (height, width): 1 - t rises as an exponential across the picture."""
        x, y = (np.linspace(-1.0, 1.0, n) if n > 1 else np.zeros(1) for n in (width, height))
        rise = np.exp(self.slope[0] * x[None, :] + self.slope[1] * y[:, None])
        t = 1.0 - self.lost * np.clip(rise, _LEAST_RISE, _MOST_RISE)
        return np.asarray(np.maximum(t, LEAST_TRANSMISSION), np.float32)

    def lit(self, factor: float) -> Veil:
        """Return the veil in a light that is stronger by a factor."""
        return replace(self, veil=self.veil * factor)

    def towards(self, other: Veil, share: float) -> Veil:
        """Return the veil that is `share` of the way to another; the other itself at 1, this one at 0.

        What is nearer than noise moves it stays where it is: the mean brightness of a still scene would wander. And it
        is never far behind: of a drone that descends fast the veil of a moment ago is too thick.
        """
        if share <= 0.0 or share >= 1.0:
            return other if share > 0.0 else self
        return Veil(
            self.veil + _step(other.veil - self.veil, share, _STILL * self.veil),
            self.lost + float(_step(other.lost - self.lost, share, _STILL)),
            self.slope + _step(other.slope - self.slope, share, _STILL),
            self.haze + share * (other.haze - self.haze),
        )


def _step(way: Array | float, share: float, still: Array | float) -> Array:
    """Return a share of what of a way lies beyond `still`, and more where too much of the way would be left."""
    step = share * _beyond(way, still)
    return np.asarray(step + _beyond(way - step, _BEHIND))


def _beyond(step: Array | float, band: Array | float) -> Array:
    """Return what of a step lies beyond a band about zero."""
    return np.asarray(np.sign(step) * np.maximum(np.abs(step) - band, 0.0))


def estimate_veil(known: Statistics) -> Veil:
    """Return the veil before a picture with these statistics (`landtool.dehaze.statistics`)."""
    fitted = _fitted()
    z = ((known - fitted["mean"]) / fitted["spread"])[None, None]  # of each guess, of one picture
    for layer in ("first", "second"):
        z = np.tanh(z @ fitted[f"{layer}_weight"] + fitted[f"{layer}_bias"])
    outputs = np.asarray((z @ fitted["last_weight"] + fitted["last_bias"]).mean(axis=(0, 1)), np.float64)
    dark = np.asarray(srgb_decode(known[[c * len(SHARES) + DARK for c in range(3)]]), np.float64)
    tint = np.exp(TINT * np.array([outputs[1], 0.0, outputs[2]]))
    veil = _sigmoid(outputs[0]) * VEIL_OF_DARK * 0.5 * (dark + dark.mean() * tint)
    light = max(float(srgb_decode(known[[c * len(SHARES) + MIDDLE for c in range(3)]]).mean()), _LEAST_LIGHT)
    lost = _cautious(_sigmoid(outputs[5]), float(veil.mean()) / light)
    sure = _sure(known)
    return Veil(sure * veil, max(sure * lost, _LEAST_LOST), SLOPE * outputs[3:5], sure * _sigmoid(outputs[6]))


def _sure(known: Statistics) -> float:
    """Return how sure it is that there is a scene at all, 0 to 1: in an even picture nothing tells white from fog."""
    darkest, brightest = (float(np.mean(known[[c * len(SHARES) + q for c in range(3)]])) for q in (DARK, BRIGHT))
    return min(max((brightest - darkest - _EVEN) / _EVEN, 0.0), 1.0)


def _cautious(lost: float, veil: float) -> float:
    """Return the share of light lost that leaves the middle light nearer to what it is.

    veil: in units of the middle light. Taking it off and not gaining enough makes a picture dark, which costs more
    than anything: fogs the regression has not seen are met half-way.
    """
    # without the veil the middle light is (1 - veil) / t of what it is
    ratio = min(max((1.0 - veil) / (1.0 - lost), _LEAST_RATIO), _MOST_RATIO)
    t: float = (1.0 - lost) * ratio ** (1.0 - _TRUST)
    return min(max(1.0 - t, _LEAST_LOST), 1.0 - LEAST_TRANSMISSION)


def _sigmoid(value: float) -> float:
    return float(1.0 / (1.0 + np.exp(-np.clip(value, -30.0, 30.0))))


@lru_cache(maxsize=1)
def _fitted() -> dict[str, NDArray[np.float32]]:
    """Return the regressions: two layers of tanh and a linear one each, with the statistics' mean and spread."""
    with (resources.files("landtool") / "data" / "veil.npz").open("rb") as file:
        return dict(np.load(file))
