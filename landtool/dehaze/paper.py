"""The dark channel prior as the paper has it, dense or estimated in places a few pixels apart."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from landtool.dehaze.air import Air, Airlight, Map
from landtool.dehaze.airlight import airlight
from landtool.dehaze.config import PaperConfig
from landtool.dehaze.dark_channel import least_colour, least_nearby
from landtool.dehaze.guided import Coefficients, guided_coefficients
from landtool.dehaze.matting import soft_matting
from landtool.dehaze.recovery import recover
from landtool.dehaze.transmission import transmission_of_least
from landtool.dehaze.veil import Veil
from landtool.types import Image

# a transmission is above 0
_LEAST_TRANSMISSION = 1e-3


class PaperRecipe:
    """K. He, J. Sun, X. Tang, Single image haze removal using dark channel prior, 2011, on the numbers as they are.

    With a subsample s the transmission is known in every s-th pixel of a row and of a column, exactly: a minimum over
    a picture made smaller is a minimum of means, and far too bright. The guided filter's sums then run over these
    places, and its coefficients are interpolated between them.
    """

    def __init__(self, config: PaperConfig) -> None:
        self.config = config

    def estimate(
        self,
        image: Image,
        veil: Veil | None = None,  # noqa: ARG002 - the paper knows nothing of it
        steady: Callable[[Airlight], Airlight] | None = None,
    ) -> Air:
        """Return the airlight, and the transmission at the picture's full size. InputError as `soft_matting`.

        steady: smooths the airlight in time.
        """
        config = self.config
        # the least colour of the least nearby is the dark channel; the transmission needs the colours apart
        least = least_nearby(image, config.patch_px)
        air = airlight(image, least_colour(least), config.airlight, config.airlight_share)
        air = steady(air) if steady else air
        coarse = transmission_of_least(self._sampled(least), air, config.omega)
        guide = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        fitted = self._fitted(image, guide, coarse)
        return Air(air, np.clip(fitted, np.float32(_LEAST_TRANSMISSION), np.float32(1.0), out=fitted))

    def recover(self, image: Image, air: Air) -> Image:
        """Return the picture without its haze; a transmission smaller than the picture is interpolated."""
        height, width = image.shape[:2]
        transmission = air.transmission
        if transmission.shape != (height, width):
            transmission = np.asarray(cv2.resize(transmission, (width, height)), dtype=np.float32)
        return recover(image, air.airlight, transmission, self.config.t0)

    def _fitted(self, image: Image, guide: Image, coarse: Map) -> Map:
        """Return a transmission (h, w) fitted to the edges of a picture and its grey guide, at their size."""
        config = self.config
        places = self._sampled(guide)
        if config.refine == "matting":
            matted = soft_matting(self._sampled(image), coarse, config.matting_lambda)
            if config.subsample == 1:
                return matted
            # as the matting itself has it: in a window of 3 x 3 the map goes with the picture
            return guided_coefficients(places, matted, 1, config.guided_epsilon).applied(guide)
        # the window as wide as the full picture's, as near as an odd number of places comes
        radius = max(round(((2 * config.guided_radius_px + 1) / config.subsample - 1) / 2), 1)
        coefficients: Coefficients = guided_coefficients(places, coarse, radius, config.guided_epsilon)
        return coefficients.applied(guide)

    def _sampled(self, image: Image) -> Image:
        """Return the pixels in the middles of squares of side `subsample`; the picture itself when that is 1."""
        if self.config.subsample == 1:
            return image
        height, width = image.shape[:2]
        size = [max(round(side / self.config.subsample), 1) for side in (width, height)]
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_NEAREST_EXACT), dtype=np.uint8)
