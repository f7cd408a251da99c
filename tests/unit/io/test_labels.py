from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.errors import InputError, UsageError
from landtool.io.coco import read_coco, write_coco
from landtool.io.labels import LabelledBox, LabelledImage, data_yaml, label_path, read_yolo, yolo_rows

WIDTH, HEIGHT = 80, 60
BOXES = (LabelledBox(0, -0.5, 3.25, 20.5, 59.5), LabelledBox(1, 10.0, 10.0, 70.0, 30.0))


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """Return the data.yaml of two pictures, one with boxes and one without."""
    for split, name, boxes in (("train", "img10", BOXES), ("train", "img2", ()), ("val", "a", BOXES[:1])):
        for top in ("images", "labels"):
            (tmp_path / top / split).mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(tmp_path / "images" / split / f"{name}.png"), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
        (tmp_path / "labels" / split / f"{name}.txt").write_text(yolo_rows(boxes, WIDTH, HEIGHT))
    (tmp_path / "data.yaml").write_text(data_yaml(("pad", "sign"), ("train", "val")))
    return tmp_path / "data.yaml"


def close(a: LabelledBox, b: LabelledBox) -> bool:
    edges = [(box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px) for box in (a, b)]
    return a.class_id == b.class_id and bool(np.allclose(edges[0], edges[1], atol=1e-5))


class TestYolo:
    def test_comes_back_as_written(self, dataset: Path) -> None:
        read = read_yolo(dataset)
        assert read.names == ("pad", "sign")
        assert list(read.splits) == ["train", "val"]
        first, second = read.read("train")
        assert (first.path.name, second.path.name) == ("img2.png", "img10.png")
        assert first.boxes == ()
        assert (second.width, second.height) == (WIDTH, HEIGHT)
        assert all(map(close, second.boxes, BOXES))

    def test_a_box_of_the_whole_picture_is_0_to_1(self) -> None:
        whole = LabelledBox(0, -0.5, -0.5, WIDTH - 0.5, HEIGHT - 0.5)
        assert list(map(float, yolo_rows([whole], WIDTH, HEIGHT).split())) == [0, 0.5, 0.5, 1, 1]

    @pytest.mark.parametrize(
        ("image", "labels"),
        [
            ("d/images/train/a.jpg", "d/labels/train/a.txt"),
            ("images/x/images/a.b.png", "images/x/labels/a.b.txt"),
            ("photos/a.jpg", "photos/a.txt"),
            ("d/images", "d/images.txt"),
        ],
    )
    def test_labels_lie_beside_the_images(self, image: str, labels: str) -> None:
        assert label_path(Path(image)) == Path(labels)

    def test_lists_of_files(self, dataset: Path) -> None:
        root = dataset.parent
        (root / "lists").mkdir()
        (root / "lists" / "a.txt").write_text("images/val/a.png\n\nimages/train/img2.png\n")
        (root / "lists" / "b.txt").write_text("\ufeff./../images/train/img10.png\n")
        dataset.write_text("names: [pad, sign]\ntrain: [lists/a.txt, lists/b.txt]\nval: images/val\nnc: 2\n")
        read = read_yolo(dataset)
        assert [image.path.name for image in read.read("train")] == ["a.png", "img2.png", "img10.png"]
        assert [len(image.boxes) for image in read.read("train")] == [1, 0, 2]

    def test_a_missing_label_file_is_a_background(self, dataset: Path) -> None:
        (dataset.parent / "labels/val/a.txt").unlink()
        assert [image.boxes for image in read_yolo(dataset).read("val")] == [()]

    @pytest.mark.parametrize(
        ("row", "extra", "edges"),
        [
            ("\ufeff0 0.5 0.5 0.5 0.5", "", (0.25, 0.25, 0.75, 0.75)),
            ("0 0.5 0.5 0.5 0.5 0.9", "", (0.25, 0.25, 0.75, 0.75)),
            ("0 0.1 0.2 0.6 0.2 0.3 0.9", "", (0.1, 0.2, 0.6, 0.9)),
            ("0 0.5 0.5 0.5 0.5 0 0 2 1 1 2", "kpt_shape: [2, 3]\n", (0.25, 0.25, 0.75, 0.75)),
            ("0 0.5 0.5 1.01 1.01", "", (0.0, 0.0, 1.0, 1.0)),
        ],
    )
    def test_kinds_of_rows(self, dataset: Path, row: str, extra: str, edges: tuple[float, float, float, float]) -> None:
        dataset.write_text(dataset.read_text() + extra)
        (dataset.parent / "labels/val/a.txt").write_text(row + "\n", encoding="utf-8")
        (image,) = read_yolo(dataset).read("val")
        x0, y0, x1, y1 = edges
        wanted = LabelledBox(0, x0 * WIDTH - 0.5, y0 * HEIGHT - 0.5, x1 * WIDTH - 0.5, y1 * HEIGHT - 0.5)
        assert close(image.boxes[0], wanted)

    @pytest.mark.parametrize(
        ("row", "said"),
        [
            ("0 0.5 0.5 0.5", "4 numbers where 5 are needed"),
            ("0 a b c d", "no number"),
            ("2 0.5 0.5 0.5 0.5", "class 2 is none of the 2"),
            ("0.5 0.5 0.5 0.5 0.5", "class 0.5 is none"),
            ("-1 0.5 0.5 0.5 0.5", "class -1 is none"),
            ("0 5 0.5 0.5 0.5", "outside the picture"),
            ("0 nan 0.5 0.5 0.5", "outside the picture"),
            ("0 0.5 0.5 -0.5 0.5", "negative"),
            ("0 0.1 0.2 0.6 0.2 0.3 0.9 0.5", "half a point"),
        ],
    )
    def test_a_broken_row_is_named(self, dataset: Path, row: str, said: str) -> None:
        (dataset.parent / "labels/val/a.txt").write_text(f"0 0.5 0.5 0.5 0.5\n\n{row}\n")
        with pytest.raises(InputError, match=rf"labels/val/a\.txt: line 3: .*{said}"):
            list(read_yolo(dataset).read("val"))

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("train: images/train\nval: images/val\n", "has no 'names'"),
            ("train: images/train\nnames: [pad]\n", "has no 'val'"),
            ("train: images/train\nval: images/val\nnames: [pad]\nnc: 2\n", "nc = 2, but the number of names is 1"),
            ("train: images/train\nval: images/val\nnames: {1: pad}\n", "must be a list, or count 0"),
            ("train: images/train\nval: images/none\nnames: [pad]\n", "val: images/none does not exist"),
            ("train: images/train\nval: images/val\nnames: [pad]\nkpt_shape: 5\n", "kpt_shape must be two"),
            ("names: [pad\n", "is no valid YAML"),
            ("- a\n", "is no dataset"),
        ],
    )
    def test_a_broken_data_yaml_is_named(self, dataset: Path, text: str, said: str) -> None:
        dataset.write_text(text)
        with pytest.raises(InputError, match=rf"data\.yaml: .*{said}"):
            read_yolo(dataset)

    def test_what_is_not_there(self, dataset: Path) -> None:
        with pytest.raises(UsageError, match=r"none\.yaml"):
            read_yolo(dataset.parent / "none.yaml")
        with pytest.raises(UsageError, match="has no split 'test'; it has train, val"):
            next(read_yolo(dataset).read("test"))
        (dataset.parent / "images/val/a.png").write_text("no picture")
        with pytest.raises(InputError, match=r"a\.png: is no image"):
            next(read_yolo(dataset).read("val"))


class TestCoco:
    def test_comes_back_as_written(self, tmp_path: Path) -> None:
        images = [LabelledImage(Path("images/a.jpg"), WIDTH, HEIGHT, BOXES), LabelledImage(Path("b.jpg"), 5, 6, ())]
        write_coco(tmp_path / "a.json", ("pad", "sign"), lambda: images)
        read = read_coco(tmp_path / "a.json", tmp_path)
        assert read.names == ("pad", "sign")
        first, second = read.images
        assert first.path == tmp_path / "images/a.jpg"
        assert all(map(close, first.boxes, BOXES))
        assert (second.width, second.height, second.boxes) == (5, 6, ())

    def test_counts_from_the_corner_and_from_1(self, tmp_path: Path) -> None:
        whole = LabelledBox(0, -0.5, -0.5, WIDTH - 0.5, HEIGHT - 0.5)
        write_coco(tmp_path / "a.json", ("pad",), lambda: [LabelledImage(Path("a.jpg"), WIDTH, HEIGHT, (whole,))])
        data = json.loads((tmp_path / "a.json").read_text())
        assert data["annotations"][0]["bbox"] == [0, 0, WIDTH, HEIGHT]
        assert [data[name][0]["id"] for name in ("images", "annotations", "categories")] == [1, 1, 1]
        assert data["annotations"][0]["area"] == WIDTH * HEIGHT

    def test_nothing_is_a_dataset_too(self, tmp_path: Path) -> None:
        write_coco(tmp_path / "a.json", ("pad",), list)
        assert read_coco(tmp_path / "a.json").images == ()

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            ({"images": None}, "has no list 'images'"),
            ({"images": [{"id": 1, "file_name": "a", "width": 0, "height": 5}]}, r"images\[0\]: its size is 0x5"),
            ({"images": [{"id": "1", "file_name": "a"}]}, r"images\[0\]: id is no whole number"),
            ({"categories": [{"id": 1, "name": "a"}, {"id": 1, "name": "b"}]}, r"categories\[1\]: id 1 is that of"),
            ({"annotations": [{"id": 7, "image_id": 9, "category_id": 1, "bbox": [0, 0, 1, 1]}]}, "no image 9"),
            ({"annotations": [{"id": 7, "image_id": 1, "category_id": 9, "bbox": [0, 0, 1, 1]}]}, "no category 9"),
            ({"annotations": [{"id": 7, "image_id": 1, "category_id": 1, "bbox": [0, 0, 1]}]}, "bbox is not x, y"),
            ({"annotations": [{"id": 7, "image_id": 1, "category_id": 1, "bbox": [0, 0, -1, 1]}]}, "negative size"),
        ],
    )
    def test_a_broken_entry_is_named(self, tmp_path: Path, change: dict[str, object], said: str) -> None:
        image = {"id": 1, "file_name": "a.jpg", "width": 5, "height": 5}
        data = {"images": [image], "annotations": [], "categories": [{"id": 1, "name": "pad"}], **change}
        (tmp_path / "a.json").write_text(json.dumps(data))
        with pytest.raises(InputError, match=rf"a\.json: .*{said}"):
            read_coco(tmp_path / "a.json")

    def test_broken_json_names_the_line(self, tmp_path: Path) -> None:
        (tmp_path / "a.json").write_text('{\n"images": [\n}')
        with pytest.raises(InputError, match=r"a\.json: line 3: no valid JSON"):
            read_coco(tmp_path / "a.json")
