"""Damage that shows in the bytes, for codecs whose decoders do not notice it."""

from __future__ import annotations

# Entropy-coded data never holds this many zero bytes in a row; a card or disk that lost a block does.
ZERO_RUN = bytes(64)
JPEG_START_OF_SCAN = b"\xff\xda"


def is_zeroed(data: bytes, *, jpeg: bool) -> bool:
    """Tell whether part of a compressed picture was replaced by zeros. Zeros may pad its end.

    jpeg: look at the scan only, since the header of a JPEG may hold any data at all.
    """
    start = max(data.find(JPEG_START_OF_SCAN), 0) if jpeg else 0
    return data.find(ZERO_RUN, start, len(data.rstrip(b"\0"))) >= 0
