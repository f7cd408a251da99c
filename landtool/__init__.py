"""landtool: perception for drones that land by camera on a moving platform, offline."""

__version__ = "0.1.0"
