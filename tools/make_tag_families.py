"""Write landtool/data/tag_families.npz from the AprilTag C library that apriltag-python installs.

The codes are facts of the families, published by the April Robotics Laboratory; landtool keeps its own table because
the binding has no call for them. Run: `python tools/make_tag_families.py`.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

import apriltag
import numpy as np

FAMILIES = ("tag36h11", "tag25h9", "tag16h5", "tagStandard41h12", "tagCustom48h12")
TARGET = Path(__file__).parent.parent / "landtool" / "data" / "tag_families.npz"


class _Family(ctypes.Structure):
    """`struct apriltag_family` of AprilTag 3.4, as far as it is read here."""

    _fields_ = [
        ("ncodes", ctypes.c_uint32),
        ("codes", ctypes.POINTER(ctypes.c_uint64)),
        ("width_at_border", ctypes.c_int),
        ("total_width", ctypes.c_int),
        ("reversed_border", ctypes.c_bool),
        ("nbits", ctypes.c_uint32),
        ("bit_x", ctypes.POINTER(ctypes.c_uint32)),
        ("bit_y", ctypes.POINTER(ctypes.c_uint32)),
    ]


def main() -> None:
    """Read every family from the library and write the table."""
    folder = Path(apriltag.__file__).parent
    library = ctypes.CDLL(str(next(folder.glob("libapriltag.*"))))
    table: dict[str, np.ndarray] = {}
    for name in FAMILIES:
        create = getattr(library, f"{name}_create")
        create.restype = ctypes.POINTER(_Family)
        family = create().contents
        bits = range(family.nbits)
        table[f"{name}.codes"] = np.array(family.codes[: family.ncodes], dtype=np.uint64)
        # unsigned in C, but bits outside the border count below zero
        bits_xy = np.array([(family.bit_x[i], family.bit_y[i]) for i in bits], dtype=np.uint32)
        table[f"{name}.bits_xy"] = bits_xy.view(np.int32).astype(np.int8)
        layout = (family.width_at_border, family.total_width, family.reversed_border)
        table[f"{name}.layout"] = np.array(layout, dtype=np.int64)
    TARGET.parent.mkdir(exist_ok=True)
    np.savez_compressed(TARGET, **table)


if __name__ == "__main__":
    main()
