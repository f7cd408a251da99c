"""Grounds without end: asphalt, grass, water ... drawn by program, or a photograph; seen at any distance."""

from landtool.synth.grounds.kinds import (
    GROUND_SEED,
    KINDS,
    VARIANTS,
    GroundKind,
    ground,
    make_ground_texture,
    share_grounds,
)
from landtool.synth.grounds.photos import load_photos, photo_ground
from landtool.synth.grounds.sampling import ground_albedo, relative_detail
from landtool.synth.grounds.texture import GroundTexture

__all__ = [
    "GROUND_SEED",
    "KINDS",
    "VARIANTS",
    "GroundKind",
    "GroundTexture",
    "ground",
    "ground_albedo",
    "load_photos",
    "make_ground_texture",
    "photo_ground",
    "relative_detail",
    "share_grounds",
]
