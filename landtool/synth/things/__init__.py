"""Bodies a scene is furnished with: what the pad lies on, what lies on the pad, what stands about."""

from landtool.synth.things.above import above_pad
from landtool.synth.things.carriers import CARRIERS, Carrier
from landtool.synth.things.props import PROPS
from landtool.synth.things.shades import drone, pole_shade, tree_shade

__all__ = ["CARRIERS", "PROPS", "Carrier", "above_pad", "drone", "pole_shade", "tree_shade"]
