"""How pictures are dehazed: every number of it, with what it must lie in."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from landtool.errors import UsageError
from landtool.tone import parse_tone

Refinement = Literal["guided", "matting"]
AirlightChoice = Literal["mean", "brightest"]
# What a number must lie in; the command line's options have the same
PAPER_BOUNDS: dict[str, tuple[float, float]] = {
    "patch_px": (1, 255),
    "airlight_share": (0.0, 1.0),
    "omega": (0.0, 1.0),
    "t0": (0.001, 1.0),
    "guided_radius_px": (1, 1000),
    "guided_epsilon": (1e-8, 1.0),
    "matting_lambda": (1e-8, 1.0),
    "subsample": (1, 16),
}
BOUNDS: dict[str, tuple[float, float]] = {
    "strength": (0.0, 1.0),
    "smooth_s": (0.0, 60.0),
    "again_s": (0.0, 60.0),
    "haze_on": (0.0, 1.0),
    "haze_off": (0.0, 1.0),
}


@dataclass(frozen=True)
class PaperConfig:
    """The five steps of the dark channel prior with the paper's numbers. Raises UsageError outside `PAPER_BOUNDS`."""

    # side of the square patch whose darkest value counts, pixels of the full picture, odd
    patch_px: int = 15
    # airlight: mean: of the pixels where the dark channel is brightest; brightest: the brightest of them (He)
    airlight: AirlightChoice = "mean"
    # the share of the pixels that are those
    airlight_share: float = 0.001
    # share of the haze that is taken off
    omega: float = 0.95
    # how the transmission is fitted to the edges: guided filter, or the matting Laplacian (a second a picture)
    refine: Refinement = "guided"
    # guided filter: radius of its windows, pixels of the full picture; and its regularisation, for values in [0, 1]
    guided_radius_px: int = 60
    guided_epsilon: float = 1e-3
    # matting: weight of the transmission before refinement
    matting_lambda: float = 1e-4
    # least transmission in the recovery
    t0: float = 0.1
    # the transmission is estimated in a picture smaller by this factor; 1 is the full size, dense and slow
    subsample: int = 4

    def __post_init__(self) -> None:
        _refuse_out_of_bounds(self, PAPER_BOUNDS)
        if self.patch_px % 2 == 0:
            raise UsageError(f"patch_px = {self.patch_px} has no middle", hint="give an odd number")


@dataclass(frozen=True)
class DehazeConfig:
    """How pictures are dehazed. Raises UsageError outside `BOUNDS`."""

    # veil: a smooth veil is taken off in linear light, made for pictures from above; paper: the dark channel prior
    recipe: Literal["veil", "paper"] = "veil"
    # the pictures' tone curve, which the estimate of haze and the recipe veil undo: srgb, none, or a gamma; the recipe
    # paper works on the numbers as they are
    tone: str = "srgb"
    # share taken off of what the recipe would take off
    strength: float = 1.0
    # time over which airlight and haze are smoothed in a video, seconds; 0: every frame for itself
    smooth_s: float = 0.3
    # a video's frames that are far from hazy are looked at again only after this time, seconds; 0: every one
    again_s: float = 0.0
    # auto: dehazing starts at this haze, and ends below that
    haze_on: float = 0.11
    haze_off: float = 0.09
    # the numbers of recipe paper
    paper: PaperConfig = field(default_factory=PaperConfig)

    def __post_init__(self) -> None:
        parse_tone(self.tone)
        _refuse_out_of_bounds(self, BOUNDS)
        if self.haze_off > self.haze_on:
            raise UsageError(
                f"haze_off = {self.haze_off:g} is above haze_on = {self.haze_on:g}",
                hint="give both, haze_off not above haze_on",
            )


def _refuse_out_of_bounds(settings: object, bounds: dict[str, tuple[float, float]]) -> None:
    for name, (low, high) in bounds.items():
        value = getattr(settings, name)
        if not low <= value <= high:
            raise UsageError(f"{name} = {value:g} is impossible", hint=f"give {low:g} to {high:g}")
