"""Read landtool's training checkpoint: an .npz with the cfg, the classes' names and a darknet weights file in it.

Keys: `cfg`, `names` (one a line) and `weights`, each the bytes of a file as uint8; `seen`, the pictures trained on,
int64. Whatever else it holds is for going on with the training. Nothing in it is ever unpickled.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from landtool.darknet.cfg import parse_cfg
from landtool.darknet.data import names_text, parse_names
from landtool.darknet.network import Network
from landtool.darknet.weights import Weights, parse_weights, weights_bytes
from landtool.errors import InputError, UsageError
from landtool.io.local import local_file

SUFFIX = ".landtool"
_HINT = f"give a checkpoint of landtool train ({SUFFIX}), or .weights"
_MOST_TEXT_BYTES = 1 << 20
_HEADER_BYTES = 1 << 12  # more than the header of any array, and of a weights file


def checkpoint_arrays(network: Network, weights: Weights, names: tuple[str, ...]) -> dict[str, NDArray[np.generic]]:
    """Return what `read_checkpoint` reads, to be saved as an .npz."""
    return {
        "cfg": np.frombuffer(network.text.encode(), np.uint8),
        "names": np.frombuffer(names_text(names).encode(), np.uint8),
        "seen": np.asarray(weights.seen, np.int64),
        "weights": np.frombuffer(weights_bytes(weights, network), np.uint8),
    }


def read_checkpoint(path: Path) -> tuple[Network, Weights, tuple[str, ...]]:
    """Return network, weights and names of a checkpoint.

    Raises UsageError when it cannot be opened, InputError when it is pickled, cut, or not what it says.
    """
    try:
        with local_file(path).open("rb") as file:
            start = file.read(2)
            if start[:1] == b"\x80":
                raise InputError("is pickled, and could run code when opened", hint=_HINT)
            file.seek(0)
            with zipfile.ZipFile(file) as archive:
                return _read(archive)
    except InputError as error:
        raise InputError(error.reason, file=path, hint=error.hint) from error
    # an entry's compression or encryption that zipfile does not know are the last two
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        raise InputError("is no whole checkpoint", file=path, hint=_HINT) from error
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=path, hint=_HINT) from error


def _read(archive: zipfile.ZipFile) -> tuple[Network, Weights, tuple[str, ...]]:
    if any(Path(name).suffix == ".pkl" for name in archive.namelist()):
        raise InputError("is pickled, and could run code when opened", hint=_HINT)
    try:
        network = parse_cfg(_array(archive, "cfg", np.uint8, _MOST_TEXT_BYTES).decode())
        names = parse_names(_array(archive, "names", np.uint8, _MOST_TEXT_BYTES).decode()).names
    except UnicodeDecodeError as error:
        raise InputError("its cfg or names are no text", hint=_HINT) from error
    if len(names) != network.classes:
        raise InputError(f"names {len(names)} of {network.classes} classes", hint=_HINT)
    # what the cfg asks for bounds what is unpacked
    data = _array(archive, "weights", np.uint8, 4 * network.parameters + _HEADER_BYTES)
    seen = int(np.frombuffer(_array(archive, "seen", np.int64, _HEADER_BYTES), "<i8")[0])
    if seen < 0:
        raise InputError(f"seen = {seen} is impossible", hint=_HINT)
    return network, replace(parse_weights(data, network), seen=seen), names


def _array(archive: zipfile.ZipFile, key: str, kind: type[np.generic], most_bytes: int) -> bytes:
    """Return the bytes of an array: one dimension of uint8, or a single int64."""
    try:
        entry = archive.getinfo(f"{key}.npy")
    except KeyError:
        raise InputError(f"has no '{key}'", hint=_HINT) from None
    if entry.file_size > most_bytes + _HEADER_BYTES:
        raise InputError(f"'{key}' is far too long ({entry.file_size} bytes)", hint=_HINT)
    stream = io.BytesIO(archive.read(entry))
    try:
        version = np.lib.format.read_magic(stream)
        readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        shape, _, dtype = readers[version](stream)
    except (ValueError, KeyError, EOFError) as error:
        raise InputError(f"'{key}' is no array", hint=_HINT) from error
    data = stream.read()
    if dtype != np.dtype(kind).newbyteorder("<") or len(shape) != (kind is np.uint8):
        raise InputError(f"'{key}' is an array of another kind ({dtype}, shape {shape})", hint=_HINT)
    if len(data) != dtype.itemsize * int(np.prod(shape, dtype=object)):
        raise InputError(f"'{key}' is cut", hint=_HINT)
    return data
