"""What the settings say of tags, as parts of a run."""

from __future__ import annotations

from landtool.config import AUTO_TONE, TagConfig
from landtool.families import canonical_name
from landtool.pad import PadSpec
from landtool.tags.reader import ReaderConfig, TagReader
from landtool.tone import parse_tone


def tag_reader(config: TagConfig, pad: PadSpec) -> TagReader:
    """Return a reader of the pad's own tags, and with `which = "all"` of every tag of the family, too.

    Where the tone curve is to be gauged it begins with sRGB's.
    """
    wanted = dict(ReaderConfig.of_pad(pad).wanted)
    if config.which == "all":
        wanted = {**dict.fromkeys(wanted), canonical_name(config.family): None}
    return TagReader(
        ReaderConfig(
            wanted,
            "srgb" if config.tone == AUTO_TONE else parse_tone(config.tone),
            config.max_hamming,
            config.min_margin,
        )
    )
