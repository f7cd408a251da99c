"""All kinds of ground by name, each painted once a process."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from landtool.errors import UsageError
from landtool.synth.grounds.loose import asphalt, gravel, sand, soil
from landtool.synth.grounds.painting import Painting
from landtool.synth.grounds.paved import brick, cobbles, concrete, tiles
from landtool.synth.grounds.soft import grass, snow, water
from landtool.synth.grounds.store import GroundStore
from landtool.synth.grounds.texture import GroundTexture

GroundKind = Literal[
    "asphalt", "concrete", "gravel", "grass", "soil", "sand", "water", "snow", "tiles", "cobbles", "brick"
]
KINDS: tuple[GroundKind, ...] = get_args(GroundKind)
VARIANTS = 2
"""Different grounds of a kind that are worth keeping: each takes 9 MB."""
GROUND_SEED = 7
"""Of the grounds that all data sets share: they are painted once in a process."""
_LOOKS = 60  # a multiple of the number of palettes of every kind, so that none is preferred
_PAINTERS: dict[GroundKind, Callable[[np.random.Generator, int], Painting]] = {
    "asphalt": asphalt,
    "concrete": concrete,
    "gravel": gravel,
    "grass": grass,
    "soil": soil,
    "sand": sand,
    "water": water,
    "snow": snow,
    "tiles": tiles,
    "cobbles": cobbles,
    "brick": brick,
}


def make_ground_texture(kind: GroundKind, rng: np.random.Generator, look: int | None = None) -> GroundTexture:
    """Return a ground of a kind, other colours and stones for other states of `rng`.

    look: which of the kind's palettes, counted round; None draws one. Raises UsageError for an unknown kind.
    """
    if kind not in _PAINTERS:
        raise UsageError(f"unknown ground '{kind}'", hint=f"known: {', '.join(KINDS)}")
    look = int(rng.integers(_LOOKS)) if look is None else look
    return _PAINTERS[kind](rng, look).texture(kind, rng)


@lru_cache(maxsize=len(KINDS) * VARIANTS)
def ground(kind: GroundKind, variant: int, seed: int = GROUND_SEED) -> GroundTexture:
    """Return a variant of a kind; the same seed (0 or more) has the same grounds. Kept, so do not change it."""

    def paint() -> GroundTexture:
        # neighbouring variants have different palettes
        first = int(np.random.default_rng([seed, KINDS.index(kind)]).integers(_LOOKS))
        return make_ground_texture(kind, np.random.default_rng([seed, KINDS.index(kind), variant]), first + variant)

    store = _shared.get("store")
    return paint() if store is None else store.get(f"{kind}-{variant}-{seed}", paint)


def share_grounds(folder: Path) -> None:
    """Share grounds from now on with the other processes that are told the same folder, which must outlive them."""
    _shared["store"] = GroundStore(folder)


_shared: dict[str, GroundStore] = {}
