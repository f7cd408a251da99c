"""Dehazing frame by frame: when it is worth it, steady in time, and fading in and out."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from threading import Lock
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landtool.dehaze.air import Airlight, Map, Recipe
from landtool.dehaze.config import DehazeConfig
from landtool.dehaze.statistics import SHARES, Statistics, small_copy, statistics
from landtool.dehaze.veil import Veil, estimate_veil
from landtool.dehaze.veil_recipe import VeilRecipe
from landtool.tone import linear_lut, parse_tone
from landtool.types import Frame, Image

# mean change of the colours' quantiles between two frames, of full scale, that only another scene makes
_FAR_FROM_HAZY = 0.5  # share of the haze at which dehazing starts
_CUT = 0.06
_LEAST_LIGHT = 1e-4


class Dehazed:
    """A frame as the stage gives it on; its picture is made when it is first asked for, by whichever thread.

    haze: the guessed share of the scene's light that the air before it takes away, 1 - t, in [0, 1], smoothed in
    time; known at once. transmission: (h, w) t that was used, of the picture's size or smaller; None where the frame
    was left alone. picture: the image, or what makes it.
    """

    def __init__(
        self, picture: Image | Callable[[], Image], haze: float, dehazed: bool, transmission: Map | None = None
    ) -> None:
        self.haze, self.dehazed, self.transmission = haze, dehazed, transmission
        self._picture = picture
        self._lock = Lock()

    @property
    def image(self) -> Image:
        """The picture (H, W, 3) BGR uint8, the frame's own array where it was left alone."""
        with self._lock:
            if callable(self._picture):
                self._picture = self._picture()
            return self._picture


class DehazeStage:
    """Takes the frames of one recording in order. Frames without a time are pictures on their own.

    when: auto: frames that are hazy enough, from `haze_on` until below `haze_off`; on: every frame.
    """

    def __init__(self, config: DehazeConfig, *, when: Literal["auto", "on"] = "auto") -> None:
        self._config = config
        self._always = when == "on"
        self._recipe = _recipe(config)
        self._linear: NDArray[np.float32] = linear_lut(parse_tone(config.tone))
        self._t_ns: int | None = None
        self._colours: Statistics | None = None
        self._veil: Veil | None = None  # in units of the picture's mean light
        self._airlight: Airlight | None = None
        self._strength = 0.0
        self._on = False
        self._haze = 1.0

    def see(self, frame: Frame) -> Dehazed:
        """Return the frame, dehazed where that is wanted.

        What is remembered from frame to frame is brought up to date here, whether the picture is asked for or not.
        """
        if self._is_still_clear(frame.t_ns):
            return Dehazed(frame.image, self._haze, False)
        small = small_copy(frame.image)
        known = statistics(small)
        elapsed = self._elapsed(frame.t_ns, known)
        if math.isinf(elapsed):
            self._veil, self._airlight, self._on = None, None, False
        veil = self._steady_veil(estimate_veil(known), self._mean_light(small), elapsed)
        self._haze = veil.haze
        if not self._gate(veil.haze, elapsed):
            self._airlight = None  # by the time it is wanted again it will be old
            return Dehazed(frame.image, veil.haze, False)
        air = self._recipe.estimate(frame.image, veil, lambda airlight: self._steady_airlight(airlight, elapsed))
        air = air.thinned(self._strength * self._config.strength)
        return Dehazed(partial(self._recipe.recover, frame.image, air), veil.haze, True, air.transmission)

    def _is_still_clear(self, t_ns: int | None) -> bool:
        """Whether the last look was so short ago, and showed so little haze, that another one can wait."""
        if t_ns is None or self._t_ns is None or self._always or self._on:
            return False
        is_far_from_hazy = self._haze < _FAR_FROM_HAZY * self._config.haze_on
        return is_far_from_hazy and 0 <= t_ns - self._t_ns < self._config.again_s * 1e9

    def _elapsed(self, t_ns: int | None, known: Statistics) -> float:
        """Return the seconds since the frame before, inf where there is none or it showed another scene."""
        colours = known[: 3 * len(SHARES)]
        elapsed = math.inf
        if t_ns is not None and self._t_ns is not None and self._colours is not None:
            cut = float(np.abs(colours - self._colours).mean()) > _CUT
            elapsed = math.inf if cut else max(t_ns - self._t_ns, 0) / 1e9
        self._t_ns, self._colours = t_ns, colours
        return elapsed

    def _mean_light(self, small: Image) -> float:
        return max(float(self._linear[small].mean()), _LEAST_LIGHT)

    def _weight(self, elapsed: float) -> float:
        """Return how much a new value counts beside the smoothed one."""
        smooth_s = self._config.smooth_s
        return 1.0 if smooth_s == 0.0 or math.isinf(elapsed) else 1.0 - math.exp(-elapsed / smooth_s)

    def _steady_veil(self, veil: Veil, light: float, elapsed: float) -> Veil:
        """Return the smoothed veil.

        Relative to the picture's mean light, which the airlight follows at once: else a flickering light would flicker
        all the more in front of a veil that stands still.
        """
        relative = veil.lit(1.0 / light)
        if self._veil is not None:
            relative = self._veil.towards(relative, self._weight(elapsed))
        self._veil = relative
        return relative.lit(light)

    def _steady_airlight(self, airlight: Airlight, elapsed: float) -> Airlight:
        if self._airlight is not None:
            airlight = self._airlight + self._weight(elapsed) * (airlight - self._airlight)
        self._airlight = airlight
        return airlight

    def _gate(self, haze: float, elapsed: float) -> bool:
        """Decide whether to dehaze, and how much of it: a switch in the middle of a scene fades."""
        self._on = self._always or haze >= (self._config.haze_off if self._on else self._config.haze_on)
        wanted = 1.0 if self._on else 0.0
        smooth_s = self._config.smooth_s
        step = 1.0 if math.isinf(elapsed) or smooth_s == 0.0 else elapsed / smooth_s
        self._strength += min(max(wanted - self._strength, -step), step)
        return self._strength > 0.0


def dehazed(image: Image, config: DehazeConfig, *, when: Literal["auto", "on"] = "on") -> Dehazed:
    """Return a picture (H, W, 3) BGR uint8 that is of no recording, dehazed by itself."""
    return DehazeStage(config, when=when).see(Frame(0, None, image))


def _recipe(config: DehazeConfig) -> Recipe:
    if config.recipe == "veil":
        return VeilRecipe(parse_tone(config.tone))
    from landtool.dehaze.paper import PaperRecipe  # loads scipy

    return PaperRecipe(config.paper)
