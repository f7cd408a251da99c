from __future__ import annotations

import io
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from landtool.darknet.checkpoint import checkpoint_arrays, read_checkpoint
from landtool.darknet.weights import weights_bytes
from landtool.errors import InputError, UsageError
from tests.unit.darknet.networks import SMALL, small

Arrays = dict[str, Any]


class Evil:
    """Makes a file when it is unpickled."""

    def __reduce__(self) -> tuple[Callable[..., object], tuple[str]]:
        return Path.touch, (Path("unpickled"),)  # type: ignore[return-value]


@pytest.fixture
def arrays() -> Arrays:
    """What a checkpoint of the small network holds."""
    return dict(checkpoint_arrays(*small(), ("pad", "sign")))


def saved(path: Path, arrays: Arrays) -> Path:
    with path.open("wb") as file:
        np.savez(file, allow_pickle=True, **arrays)
    return path


def test_what_was_saved_comes_back(arrays: Arrays, tmp_path: Path) -> None:
    arrays["momentum.0"] = np.zeros((3, 4), np.float32)
    network, weights = small()
    read_network, read, names = read_checkpoint(saved(tmp_path / "a.landtool", arrays))
    assert read_network == network
    assert read_network.text == SMALL
    assert names == ("pad", "sign")
    assert read.seen == 640
    assert weights_bytes(read, network) == weights_bytes(weights, network)


def drop(key: str) -> Callable[[Arrays], None]:
    return lambda arrays: arrays.pop(key)


def put(key: str, value: object) -> Callable[[Arrays], None]:
    return lambda arrays: arrays.update({key: value})


def text(value: str | bytes) -> object:
    return np.frombuffer(value if isinstance(value, bytes) else value.encode(), np.uint8)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (drop("cfg"), "has no 'cfg'"),
        (drop("weights"), "has no 'weights'"),
        (drop("seen"), "has no 'seen'"),
        (put("cfg", text("<html>")), "line 1: is neither"),
        (put("cfg", text(b"\xff\xff")), "its cfg or names are no text"),
        (put("cfg", np.zeros(2 << 20, np.uint8)), r"'cfg' is far too long"),
        (put("names", text("pad\n")), "names 1 of 2 classes"),
        (put("names", np.asarray(["pad", "sign"])), r"'names' is an array of another kind \(<U4, shape \(2,\)\)"),
        (put("names", np.asarray([Evil()], object)), r"'names' is an array of another kind \(object, shape"),
        (put("seen", np.asarray(-1, np.int64)), "seen = -1 is impossible"),
        (put("seen", np.asarray([1, 2], np.int64)), "'seen' is an array of another kind"),
        (put("seen", np.asarray(0.5)), "'seen' is an array of another kind"),
        (put("weights", np.zeros((2, 8), np.uint8)), "'weights' is an array of another kind"),
        (put("weights", np.zeros(20, np.uint8)), "does not fit the cfg"),
        (put("weights", np.zeros(1 << 24, np.uint8)), "'weights' is far too long"),
    ],
)
def test_what_is_wrong_in_it(
    change: Callable[[Arrays], None], said: str, arrays: Arrays, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    change(arrays)
    with pytest.raises(InputError, match=f"a.landtool: .*{said}"):
        read_checkpoint(saved(tmp_path / "a.landtool", arrays))
    assert not Path("unpickled").exists()


@pytest.mark.parametrize("length", [0, 1, 100, 3000, -1, -30])
def test_a_cut_file(length: int, arrays: Arrays, tmp_path: Path) -> None:
    path = saved(tmp_path / "a.landtool", arrays)
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(InputError, match="is no whole checkpoint"):
        read_checkpoint(path)


def test_a_damaged_file(arrays: Arrays, tmp_path: Path) -> None:
    path = saved(tmp_path / "a.landtool", arrays)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(InputError, match="is no whole checkpoint"):
        read_checkpoint(path)


@pytest.mark.parametrize("zipped", [False, True], ids=["old", "new"])
def test_pickles_are_never_opened(zipped: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path, data = tmp_path / "best.pt", pickle.dumps(Evil(), protocol=2)
    if zipped:  # as torch.save writes
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("best/data.pkl", data)
    else:
        path.write_bytes(data)
    with pytest.raises(InputError, match=r"best.pt: is pickled, and could run code when opened; give a checkpoint"):
        read_checkpoint(path)
    assert not Path("unpickled").exists()


def test_a_zip_bomb_is_not_unpacked(arrays: Arrays, tmp_path: Path) -> None:
    path = tmp_path / "a.landtool"
    arrays["weights"] = np.zeros(1 << 27, np.uint8)
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)
    assert path.stat().st_size < 1 << 18
    with pytest.raises(InputError, match=r"'weights' is far too long \(134217856 bytes\)"):
        read_checkpoint(path)


def test_a_header_that_claims_more_than_there_is(arrays: Arrays, tmp_path: Path) -> None:
    path = saved(tmp_path / "a.landtool", arrays)
    with zipfile.ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    claims = io.BytesIO()
    np.lib.format.write_array_header_1_0(claims, {"descr": "|u1", "fortran_order": False, "shape": (1 << 60,)})
    for bad, said in ((claims.getvalue() + b"12", "'cfg' is cut"), (b"\x93NUMPY", "'cfg' is no array")):
        with zipfile.ZipFile(path, "w") as archive:
            for name, data in {**entries, "cfg.npy": bad}.items():
                archive.writestr(name, data)
        with pytest.raises(InputError, match=said):
            read_checkpoint(path)


def test_a_checkpoint_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="does not exist"):
        read_checkpoint(tmp_path / "a.landtool")
