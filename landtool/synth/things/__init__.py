"""Bodies a scene is furnished with: what the pad lies on, what lies on the pad, what stands about."""

from landtool.synth.things.above import above_pad
from landtool.synth.things.carriers import BOXES, CARRIERS, DECKS, VEHICLES, Carrier
from landtool.synth.things.props import PROPS
from landtool.synth.things.shades import drone, pole_shade, tree_shade

__all__ = [
    "BOXES",
    "CARRIERS",
    "DECKS",
    "PROPS",
    "VEHICLES",
    "Carrier",
    "above_pad",
    "drone",
    "pole_shade",
    "tree_shade",
]
