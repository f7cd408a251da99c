"""A cursor over CDR, the byte layout of ROS 2 messages, and its little-endian writer.

Written here because the types landtool reads are fixed: a log needs no definitions then, which recorders leave empty
when they do not find them, and a picture's bytes are a view of the chunk instead of a copy.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

# second byte of the encapsulation header -> (byte order, largest alignment); XCDR2 aligns 8-byte values to 4
_KINDS = {0x00: (">", 8), 0x01: ("<", 8), 0x06: (">", 4), 0x07: ("<", 4)}
_HEADER = 4


class BrokenMessageError(ValueError):
    """A message whose bytes are not what its type says; the text is the reason, for a person."""


class CdrReader:
    """Reads the fields of one message in order. Every method raises BrokenMessageError past the end of the data."""

    def __init__(self, data: bytes | memoryview) -> None:
        self._data = memoryview(data)
        if len(self._data) < _HEADER:
            raise BrokenMessageError(f"the message has only {len(self._data)} bytes")
        kind = self._data[1]
        if self._data[0] != 0 or kind not in _KINDS:
            raise BrokenMessageError(f"the CDR kind 0x{self._data[0]:02x}{kind:02x} is not supported")
        self._order, self._max_align = _KINDS[kind]
        self._at = _HEADER

    def int32(self) -> int:
        """Read an int32."""
        return int(self._numbers("i", 1)[0])

    def uint32(self) -> int:
        """Read a uint32."""
        return int(self._numbers("I", 1)[0])

    def uint8(self) -> int:
        """Read a uint8 or a bool."""
        return int(self._numbers("B", 1)[0])

    def float64s(self, count: int) -> tuple[float, ...]:
        """Read `count` float64 (an array of fixed length)."""
        return self._numbers("d", count) if count else ()

    def float64_sequence(self) -> tuple[float, ...]:
        """Read a float64 sequence, its length first."""
        return self.float64s(self.uint32())

    def blob(self) -> memoryview:
        """Read a uint8 sequence, its length first; a view into the message, not a copy."""
        return self._take(self.uint32())

    def string(self) -> str:
        """Read a string; the closing zero byte is not part of it."""
        raw = bytes(self._take(self.uint32()))
        return raw.removesuffix(b"\0").decode("utf-8", errors="replace")

    def stamp_ns(self) -> int:
        """Read a builtin_interfaces/Time as nanoseconds."""
        return self.int32() * 1_000_000_000 + self.uint32()

    def _numbers(self, code: str, count: int) -> tuple[float, ...]:
        size = struct.calcsize(f"={code}")
        # alignment is counted from the end of the encapsulation header
        self._at += -(self._at - _HEADER) % min(size, self._max_align)
        return struct.unpack(f"{self._order}{count}{code}", self._take(size * count))

    def _take(self, length: int) -> memoryview:
        end = self._at + length
        if end > len(self._data):
            raise BrokenMessageError(f"the message ends after {len(self._data)} bytes, it needs {end}")
        part = self._data[self._at : end]
        self._at = end
        return part


class CdrWriter:
    """Builds one little-endian message, field by field; methods return the writer so that calls chain."""

    def __init__(self) -> None:
        self._data = bytearray(b"\x00\x01\x00\x00")

    def int32(self, value: int) -> CdrWriter:
        """Append an int32."""
        return self._numbers("i", [value])

    def uint32(self, *values: int) -> CdrWriter:
        """Append one or more uint32."""
        return self._numbers("I", values)

    def uint8(self, value: int) -> CdrWriter:
        """Append a uint8 or a bool."""
        return self._numbers("B", [value])

    def float64s(self, values: Iterable[float]) -> CdrWriter:
        """Append an array of fixed length."""
        return self._numbers("d", values)

    def float64_sequence(self, values: Iterable[float]) -> CdrWriter:
        """Append a sequence, its length first."""
        numbers = tuple(values)
        self.uint32(len(numbers))
        return self.float64s(numbers) if numbers else self

    def blob(self, value: bytes | memoryview) -> CdrWriter:
        """Append a uint8 sequence, its length first."""
        self.uint32(len(value))
        self._data += value
        return self

    def string(self, value: str) -> CdrWriter:
        """Append a string and its closing zero byte."""
        return self.blob(value.encode() + b"\0")

    def stamp_ns(self, value_ns: int) -> CdrWriter:
        """Append nanoseconds as a builtin_interfaces/Time. Raises OverflowError when its int32 cannot hold them."""
        seconds, nanoseconds = divmod(value_ns, 1_000_000_000)
        if not -(2**31) <= seconds < 2**31:
            raise OverflowError(f"the time {value_ns} ns does not fit a ROS stamp")
        return self.int32(seconds).uint32(nanoseconds)

    def finish(self) -> bytes:
        """Return the message."""
        return bytes(self._data)

    def _numbers(self, code: str, values: Iterable[float]) -> CdrWriter:
        numbers = tuple(values)
        size = struct.calcsize(f"={code}")
        self._data += bytes(-(len(self._data) - _HEADER) % size)
        self._data += struct.pack(f"<{len(numbers)}{code}", *numbers)
        return self
