"""Pictures with a twin in clear air as an evaluation sees them: dehazed, and how near to the twin that comes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from landtool.dehaze.config import DehazeConfig
from landtool.dehaze.stage import dehazed
from landtool.errors import InputError
from landtool.evaluate.dataset import FogPairs
from landtool.evaluate.dehazing import ClearChange, ScoredPair, change_levels, pair_score
from landtool.io.images import PictureError, read_picture
from landtool.types import Image

OnPicture = Callable[[], None]


def see_pairs(part: FogPairs, config: DehazeConfig, on_picture: OnPicture) -> Iterator[ScoredPair]:
    """Dehaze every hazy picture on its own, whatever its haze. Raises InputError for one that cannot be read."""
    for pair in part.pairs:
        hazy, clear = image_of(pair.hazy), image_of(pair.clear)
        seen = dehazed(hazy, config)
        try:
            score = pair_score(hazy, seen.image, clear)
        except InputError as error:
            raise InputError(error.reason, file=pair.hazy, hint=error.hint) from error
        yield ScoredPair(part.name, pair.name, (part.name, pair.name), pair.fog_per_m, seen.haze, score)
        on_picture()


def change_of_clear(part: str, file: str, image: Image, config: DehazeConfig) -> ClearChange:
    """Return what dehazing where it is needed does to a picture (H, W, 3) that is not hazy."""
    seen = dehazed(image, config, when="auto")
    return ClearChange((part, file), change_levels(image, seen.image) if seen.dehazed else 0.0)


def image_of(path: Path) -> Image:
    """Return a picture (H, W, 3) BGR. Raises InputError when it cannot be read whole."""
    try:
        return read_picture(path).image
    except PictureError as error:
        raise InputError(str(error), file=path, hint="replace or remove it") from error
