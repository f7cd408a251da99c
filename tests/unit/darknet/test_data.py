from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.darknet.data import (
    data_text,
    names_text,
    parse_data,
    parse_names,
    read_darknet_dataset,
    read_data,
    read_names,
    write_data,
    write_names,
)
from landtool.errors import InputError, UsageError

DARKNETS_OWN = (
    "classes= 2\r\ntrain  = data/train.txt\r\n# once\r\nvalid  = data/a#b.txt\r\nnames = data/obj.names\r\n"
    "backup = backup/\r\neval=coco\r\n"
)


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """Return the .data file of a data set: labels beside one picture, in a folder of their own for the other."""
    for name in ("obj/a.png", "images/b.png"):
        (tmp_path / name).parent.mkdir()
        cv2.imwrite(str(tmp_path / name), np.zeros((20, 40, 3), np.uint8))
    (tmp_path / "labels").mkdir()
    (tmp_path / "obj" / "a.txt").write_text("0 0.5 0.5 0.5 0.5\n")
    (tmp_path / "labels" / "b.txt").write_text("1 0.5 0.5 1 1\n")
    (tmp_path / "train.txt").write_text(f"obj/a.png\n{tmp_path}/images/b.png\n")
    (tmp_path / "valid.txt").write_text("images/b.png\r\n\r\n")
    (tmp_path / "obj.names").write_text("pad\nsign\n")
    path = tmp_path / "obj.data"
    path.write_text(data_text(2, train="train.txt", valid="valid.txt", names="obj.names", backup="backup"))
    return path


class TestFiles:
    @pytest.mark.parametrize("mark", ["", "\ufeff"])
    def test_data_comes_back_byte_for_byte(self, mark: str, tmp_path: Path) -> None:
        source, copy = tmp_path / "obj.data", tmp_path / "copy.data"
        source.write_bytes((mark + DARKNETS_OWN).encode())
        data = read_data(source)
        assert (data.classes, data.train, data.valid, data.names, data.backup) == (
            2,
            "data/train.txt",
            "data/a#b.txt",
            "data/obj.names",
            "backup/",
        )
        write_data(copy, data)
        assert copy.read_bytes() == source.read_bytes()

    @pytest.mark.parametrize("text", ["pad\nsign\n", "pad\r\nsign", "\ufeffpad\n sign \n\n"])
    def test_names_come_back_byte_for_byte(self, text: str, tmp_path: Path) -> None:
        source, copy = tmp_path / "obj.names", tmp_path / "copy.names"
        source.write_bytes(text.encode())
        names = read_names(source, 2)
        assert names.names == ("pad", "sign")
        write_names(copy, names)
        assert copy.read_bytes() == source.read_bytes()

    def test_what_is_written_new_is_read(self) -> None:
        data = parse_data(data_text(3, train="t.txt", valid="v.txt", names="n", backup="b"))
        assert (data.classes, data.train, data.valid, data.names, data.backup) == (3, "t.txt", "v.txt", "n", "b")
        assert parse_names(names_text(["a", "b c"])).names == ("a", "b c")


class TestDataset:
    def test_labels_beside_the_picture_or_in_labels(self, dataset: Path) -> None:
        read = read_darknet_dataset(dataset)
        assert read.names == ("pad", "sign")
        first, second = read.read("train")
        assert [box.class_id for box in first.boxes + second.boxes] == [0, 1]
        assert first.boxes[0].x_min_px == pytest.approx(9.5)
        assert [image.path.name for image in read.read("val")] == ["b.png"]

    def test_paths_from_where_darknet_is_called(self, dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (dataset.parent / "cfg").mkdir()
        moved = dataset.rename(dataset.parent / "cfg" / "obj.data")
        monkeypatch.chdir(dataset.parent)
        assert [len(image.boxes) for image in read_darknet_dataset(moved).read("train")] == [1, 1]

    @pytest.mark.parametrize(
        ("file", "content", "said"),
        [
            ("obj.names", "pad\n", r"obj.names: holds 1 name for 2 classes; give one line a class"),
            ("obj.names", "pad\n\nsign\n", r"obj.names: line 2: is empty"),
            ("obj.names", "\n", r"obj.names: holds no name"),
            ("train.txt", "\n\n", r"train.txt: names no picture"),
            ("train.txt", b"\xff\xfe", r"train.txt: is no text"),
            ("obj.data", "classes = 2\ntrain = t\nvalid = v\n", r"obj.data: line 1: \[data\] has no 'names'"),
            ("obj.data", "classes = two\n", r"obj.data: line 1: classes = two is no number"),
            ("obj.data", "classes = 2\nclasses = 2\n", r"obj.data: line 2: 'classes' stands twice"),
            ("obj.data", "classes = 2\ntrain =\nvalid = v\nnames = n", r"obj.data: line 2: train names no file"),
            ("obj.data", "{}", r"obj.data: line 1: is no key=value; give a darknet .data file"),
            ("obj.data", "classes=1\ntrain=t\nvalid=v\nnames=n\ntrian=t", r"obj.data: line 5: \[data\] key 'trian'"),
            ("obj.data", data_text(2, train="no.txt", valid="v", names="obj.names", backup=""), "no.txt: does not exi"),
        ],
    )
    def test_what_is_wrong_is_said(self, file: str, content: str | bytes, said: str, dataset: Path) -> None:
        dataset.with_name(file).write_bytes(content if isinstance(content, bytes) else content.encode())
        with pytest.raises(InputError, match=said):
            read_darknet_dataset(dataset)

    def test_a_data_file_that_is_not_there(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match="does not exist"):
            read_darknet_dataset(tmp_path / "obj.data")

    def test_a_picture_that_is_not_there(self, dataset: Path) -> None:
        dataset.with_name("valid.txt").write_text("images/c.png\n")
        with pytest.raises(InputError, match=r"c\.png: does not exist"):
            list(read_darknet_dataset(dataset).read("val"))
