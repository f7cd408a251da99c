"""Datasets of others: YOLO folders without a data.yaml, COCO folders with the pictures anywhere near."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.errors import InputError, UsageError
from landtool.io.coco import read_coco
from landtool.io.yolo_folder import is_yolo_folder, read_yolo_folder

ROW = "0.5 0.5 0.5 0.5\n"


def picture(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.zeros((30, 40, 3), np.uint8))
    return path


def labelled(folder: Path, name: str, *classes: int) -> None:
    """Put a picture and its labels into a YOLO folder; without classes it has no label file."""
    picture(folder / "images" / f"{name}.png")
    labels = folder / "labels" / f"{name}.txt"
    labels.parent.mkdir(parents=True, exist_ok=True)
    if classes:
        labels.write_text("".join(f"{class_id} {ROW}" for class_id in classes))


class TestYolo:
    def test_a_folder_without_splits_is_test(self, tmp_path: Path) -> None:
        labelled(tmp_path, "a10", 0)
        labelled(tmp_path, "a2")
        assert is_yolo_folder(tmp_path)
        dataset = read_yolo_folder(tmp_path)
        assert (dataset.file, dataset.names, list(dataset.splits)) == (tmp_path, ("pad",), ["test"])
        assert [(image.path.name, len(image.boxes)) for image in dataset.read("test")] == [
            ("a2.png", 0),
            ("a10.png", 1),
        ]
        assert dataset.notes == (
            "it is not split: all its pictures count as test",
            "there is no classes.txt: its class 0 is 'pad'",
        )

    def test_splits_are_folders(self, tmp_path: Path) -> None:
        for name in ("train/a", "val/b", "val/c", "stray"):
            labelled(tmp_path, name, 0)
        dataset = read_yolo_folder(tmp_path)
        assert {split: len(files) for split, files in dataset.splits.items()} == {"train": 1, "val": 2}
        assert [image.boxes[0].class_id for image in dataset.read("val")] == [0, 0]
        assert dataset.notes[0] == "pictures outside of train, val are left out: 1"

    @pytest.mark.parametrize("place", ["classes.txt", "labels/classes.txt"])
    def test_names_are_the_lines_of_a_file(self, tmp_path: Path, place: str) -> None:
        labelled(tmp_path, "test/a", 1)
        (tmp_path / place).write_text("\ufeffpad\n traffic sign \n\n", encoding="utf-8")
        dataset = read_yolo_folder(tmp_path)
        assert dataset.names == ("pad", "traffic sign")
        assert dataset.notes == ()

    def test_without_the_file_classes_are_numbers(self, tmp_path: Path) -> None:
        labelled(tmp_path, "a", 0, 3)
        dataset = read_yolo_folder(tmp_path)
        assert dataset.names == ("0", "1", "2", "3")
        assert dataset.notes[1] == (
            "there is no classes.txt: its classes are named 0 to 3; add classes.txt, a name a line, for what they are"
        )

    def test_a_class_the_file_does_not_name(self, tmp_path: Path) -> None:
        labelled(tmp_path, "a", 2)
        (tmp_path / "classes.txt").write_text("pad\n")
        with pytest.raises(InputError, match=r"a\.txt: line 1: class 2 is none of the 1"):
            list(read_yolo_folder(tmp_path).read("test"))

    def test_a_class_beyond_all_reason(self, tmp_path: Path) -> None:
        labelled(tmp_path, "a", 10**12)
        with pytest.raises(InputError, match=r"a\.txt: line 1: class 1000000000000 is none"):
            read_yolo_folder(tmp_path)

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            (b"", "is empty"),
            (b"a\n\nb\n", "line 2: is empty"),
            (b"a\na\n", "line 2: a is named twice"),
            (b"\xff", "no UTF"),
        ],
    )
    def test_broken_names(self, tmp_path: Path, text: bytes, said: str) -> None:
        labelled(tmp_path, "a", 0)
        (tmp_path / "classes.txt").write_bytes(text)
        with pytest.raises(InputError, match=rf"classes\.txt: .*{said}"):
            read_yolo_folder(tmp_path)

    def test_nothing_in_it(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match="has no folders images and labels"):
            read_yolo_folder(tmp_path)
        for name in ("images", "labels"):
            (tmp_path / name).mkdir()
        dataset = read_yolo_folder(tmp_path)
        assert (dataset.names, list(dataset.read("test"))) == (("pad",), [])


def coco(path: Path, *files: str) -> Path:
    images = [{"id": i, "file_name": file, "width": 40, "height": 30} for i, file in enumerate(files, start=1)]
    data = {"images": images, "annotations": [], "categories": [{"id": 1, "name": "pad"}]}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(data))
    return path


class TestCoco:
    @pytest.mark.parametrize(
        ("json_name", "file", "place"),
        [
            ("all.json", "a.png", "a.png"),
            ("all.json", "images/a.png", "images/a.png"),
            ("all.json", "a.png", "images/a.png"),
            ("annotations/all.json", "a.png", "annotations/a.png"),
            ("annotations/val.json", "images/val/a.png", "images/val/a.png"),
            ("annotations/val.json", "a.png", "images/a.png"),
            ("annotations/val.json", "a.png", "images/val/a.png"),
            ("annotations/val.json", "sub/a.png", "images/val/sub/a.png"),
            ("annotations/instances_val2017.json", "a.png", "val2017/a.png"),
            ("annotations/instances_val2017.json", "a.png", "images/val2017/a.png"),
        ],
    )
    def test_pictures_are_found(self, tmp_path: Path, json_name: str, file: str, place: str) -> None:
        picture(tmp_path / place)
        (image,) = read_coco(coco(tmp_path / json_name, file)).images
        assert image.path == tmp_path / place

    def test_one_missing_picture_does_not_lose_the_others(self, tmp_path: Path) -> None:
        picture(tmp_path / "images" / "b.png")
        read = read_coco(coco(tmp_path / "annotations" / "all.json", "a.png", "b.png"))
        assert [image.path for image in read.images] == [tmp_path / "images" / name for name in ("a.png", "b.png")]

    def test_a_folder_that_is_named_is_taken(self, tmp_path: Path) -> None:
        picture(tmp_path / "a.png")
        (image,) = read_coco(coco(tmp_path / "all.json", "a.png"), tmp_path / "other").images
        assert image.path == tmp_path / "other" / "a.png"

    def test_no_picture_anywhere(self, tmp_path: Path) -> None:
        (image,) = read_coco(coco(tmp_path / "annotations" / "all.json", "a.png")).images
        assert image.path == tmp_path / "annotations" / "a.png"
