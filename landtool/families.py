"""The AprilTag families landtool knows: their codes and the picture of every tag.

The table is made by tools/make_tag_families.py from the AprilTag library.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from landtool.errors import UsageError

FAMILIES = ("tag36h11", "tag25h9", "tag16h5", "tagStandard41h12", "tagCustom48h12")


@dataclass(frozen=True, eq=False)
class TagFamily:
    """One family's layout.

    codes: (n,) uint64, most significant bit first. bits_xy: (nbits, 2), the module of each bit, counted from the
    border's top-left module, so outside bits have places below 0. border_modules: width of the measured
    quadrilateral, the "size" of a tag. total_modules: width of the reference image. reversed_border: the border is
    white inside black instead of black inside white.
    """

    name: str
    codes: NDArray[np.uint64]
    bits_xy: NDArray[np.int64]
    border_modules: int
    total_modules: int
    reversed_border: bool

    @property
    def margin_modules(self) -> int:
        """Modules of the reference image outside the measured quadrilateral, on each side."""
        return (self.total_modules - self.border_modules) // 2

    def modules(self, tag_id: int) -> NDArray[np.bool_]:
        """Return the upright reference image (total, total), True where a module is white.

        Raises UsageError for an id the family does not have.
        """
        if not 0 <= tag_id < len(self.codes):
            raise UsageError(f"{self.name} has no tag {tag_id}", hint=f"ids go from 0 to {len(self.codes) - 1}")
        margin, total = self.margin_modules, self.total_modules
        image = np.zeros((total, total), dtype=np.bool_)
        # one ring of white modules: around a black border, or as the reversed border itself
        first = margin if self.reversed_border else margin - 1
        image[first : total - first, first : total - first] = True
        image[first + 1 : total - first - 1, first + 1 : total - first - 1] = False
        code = int(self.codes[tag_id])
        for i, (x, y) in enumerate(self.bits_xy):
            image[y + margin, x + margin] = bool(code >> (len(self.bits_xy) - 1 - i) & 1)
        return image


def canonical_name(name: str) -> str:
    """Return the family's name for any way to write it: tag36h11, 36h11, DICT_APRILTAG_36h11.

    Raises UsageError for an unknown family, naming the nearest known one.
    """
    wanted = name.strip().lower().removeprefix("dict_apriltag_").removeprefix("tag")
    by_short = {family.lower().removeprefix("tag"): family for family in FAMILIES}
    if wanted in by_short:
        return by_short[wanted]
    near = difflib.get_close_matches(wanted, by_short, n=1, cutoff=0.0)[0]
    raise UsageError(f"unknown tag family '{name}'", hint=f"nearest is {by_short[near]}; known: {', '.join(FAMILIES)}")


@cache
def tag_family(name: str) -> TagFamily:
    """Return the family called `name` in any of its spellings. Raises UsageError when there is none."""
    name = canonical_name(name)
    with resources.files("landtool").joinpath("data/tag_families.npz").open("rb") as file, np.load(file) as table:
        border, total, reversed_border = (int(v) for v in table[f"{name}.layout"])
        bits_xy = table[f"{name}.bits_xy"].astype(np.int64)
        return TagFamily(name, table[f"{name}.codes"], bits_xy, border, total, bool(reversed_border))
