"""Whether a video file ends where its own outer structure says it should."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

EBML_SEGMENT = b"\x18\x53\x80\x67"
# Transport stream packets: their length, and where their sync byte is. Plain, with time codes (M2TS), with parity.
TS_PACKETS = ((188, 0), (192, 4), (204, 0))
TS_SYNC = 0x47


def is_cut(path: Path, format_name: str) -> bool:
    """Tell whether the file ends before its structure does. False too where the structure does not say.

    format_name: FFmpeg's name of the container, such as "mov,mp4,m4a,3gp,3g2,mj2".
    """
    size = path.stat().st_size
    names = format_name.split(",")
    with path.open("rb") as file:
        if "mpegts" in names:
            return size % _ts_packet_length(file) != 0
        if "mp4" in names:
            return _last_box_end(file, size) > size
        if "matroska" in names:
            return _segment_end(file, size) > size
        if "avi" in names:
            return _riff_end(file, size) > size
    return False


def has_box(path: Path, kind: bytes) -> bool:
    """Tell whether an MP4 or MOV file has a top-level box of that four-letter kind."""
    size = path.stat().st_size
    with path.open("rb") as file:
        position = 0
        while position + 8 <= size:
            length, name = _box(file, position, size)
            if name == kind:
                return True
            position += max(length, 8)
    return False


def _box(file: BinaryIO, position: int, size: int) -> tuple[int, bytes]:
    """Length and kind of the MP4 box at a position. ISO/IEC 14496-12, 4.2."""
    file.seek(position)
    head = file.read(16)
    length = int.from_bytes(head[:4], "big")
    if length == 1:
        length = int.from_bytes(head[8:16], "big")
    elif length == 0:  # the last box may leave its length open
        length = size - position
    return length, head[4:8]


def _last_box_end(file: BinaryIO, size: int) -> int:
    position = 0
    while position < size:
        if position + 8 > size:
            return position + 8
        length, name = _box(file, position, size)
        if length < 8 or not name.isascii():  # no box: damage, which decoding will meet and report
            return size
        position += length
    return position


def _vint(data: bytes) -> tuple[int, int]:
    """Value and length of an EBML size; value -1 when it is left unknown. RFC 8794, 4."""
    length = 8 - data[0].bit_length() + 1
    if length > 8 or len(data) < length:
        return -1, max(1, len(data))
    value = int.from_bytes(data[:length], "big") & ((1 << 7 * length) - 1)
    return (-1, length) if value == (1 << 7 * length) - 1 else (value, length)


def _segment_end(file: BinaryIO, size: int) -> int:
    head = file.read(4096)
    start = head.find(EBML_SEGMENT)
    if start < 0 or len(head) < start + 12:
        return size
    length, width = _vint(head[start + 4 : start + 12])
    return size if length < 0 else start + 4 + width + length


def _ts_packet_length(file: BinaryIO) -> int:
    head = file.read(4096)
    for length, sync in TS_PACKETS:
        if all(byte == TS_SYNC for byte in head[sync::length]):
            return length
    return 1  # damaged at its start, so its packets cannot be counted


def _riff_end(file: BinaryIO, size: int) -> int:
    """End of the last RIFF list; files over 1 GB have several."""
    position = 0
    while position + 8 <= size:
        file.seek(position)
        head = file.read(8)
        if head[:4] != b"RIFF":
            return size
        position += 8 + int.from_bytes(head[4:], "little")
    return position
