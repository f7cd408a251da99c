"""The landing pads of a frame: what is looked for in which stage, by which measurement, and which pose is believed."""
