"""Damage that shows in the bytes, for codecs whose decoders do not notice it."""

from __future__ import annotations

# Entropy-coded data never holds this many zero bytes in a row; a card or disk that lost a block does.
ZERO_RUN = bytes(64)
_START_OF_SCAN = 0xDA
_END_OF_IMAGE = b"\xff\xd9"
_WITHOUT_LENGTH = (0x01, *range(0xD0, 0xD9))


def is_zeroed(data: bytes, *, jpeg: bool) -> bool:
    """Tell whether part of a compressed picture was replaced by zeros. Zeros may pad its end.

    jpeg: look at the picture's own scan only; its header may hold any data, a thumbnail with a scan of its own too,
    and a camera may append more pictures behind its end.
    """
    start, end = 0, len(data.rstrip(b"\0"))
    if jpeg:
        start = _jpeg_scan(data)
        after = data.find(_END_OF_IMAGE, start)
        end = after if after >= 0 else end
    return data.find(ZERO_RUN, start, end) >= 0


def _jpeg_scan(data: bytes) -> int:
    """Walk the JPEG's segments to its start of scan; 0 where they are broken."""
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == _START_OF_SCAN:
            return at
        if marker == 0xFF:  # fill byte
            at += 1
        elif marker in _WITHOUT_LENGTH:
            at += 2
        else:
            at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return 0
