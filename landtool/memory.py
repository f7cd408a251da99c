"""Ask the C library to keep memory that is needed again at once: large arrays come and go with every picture."""

from __future__ import annotations

import ctypes
import sys

# mallopt(3): its parameters, the most that the second accepts, and more than any process has free
_TRIM_THRESHOLD, _MMAP_THRESHOLD, _MMAP_MAX = -1, -3, -4
_LARGEST_MMAP, _NEVER_TRIM = 32 << 20, 1 << 30


def keep_memory(*, even_largest: bool = False) -> None:
    """Have GNU's C library reuse what is freed; to give it back and have it cleared costs a tenth and more.

    even_largest: blocks above 32 MB, too. Does nothing where there is no such library.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is None:
        return
    if even_largest:
        mallopt(_MMAP_MAX, 0)
    else:
        mallopt(_MMAP_THRESHOLD, _LARGEST_MMAP)
    mallopt(_TRIM_THRESHOLD, _NEVER_TRIM)
