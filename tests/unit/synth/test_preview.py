"""The preview of a data set: labels where they belong, statistics of everything, and errors for broken sets."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.camera import Camera
from landtool.errors import InputError, OutputExistsError, UsageError
from landtool.geometry import Pose
from landtool.io.labels import data_yaml, label_path, yolo_rows
from landtool.io.tables import format_cell
from landtool.strokes import SKY, VERMILLION, YELLOW
from landtool.synth.dataset.rows import TRUTH_COLUMNS, boxes_of, truth_row
from landtool.synth.preview import dataset_correlations, write_preview
from landtool.synth.preview.facts import read_facts
from landtool.synth.preview.labels import labelled, read_labels
from landtool.synth.preview.sheet import contact_sheet, evenly, fitted
from landtool.synth.sample import Truth

SIZE = (640, 480)
BOX = (100.0, 50.0, 300.0, 200.0)
TAG = np.array([[180.0, 100.0], [220.0, 100.0], [220.0, 140.0], [180.0, 140.0]])
CAMERA = Camera.from_hfov(*SIZE, 60.0)


def _truth(index: int, rng: np.random.Generator) -> Truth:
    everywhere = Truth(
        CAMERA,
        present=False,
        tilt_rad=rng.uniform(0, 0.5),
        beta_per_m=0.05 * (index % 2),
        light=rng.uniform(0.5, 2),
        ground=("sand", "mud")[index % 2],
        signs=("text", "old tyre") * (index % 3),
        applied=(("weather", "clear sky"), ("defocus_radius_px", 2.0 * index)),
    )
    if index % 5 == 4:
        return everywhere
    return replace(
        everywhere,
        present=True,
        visible_fraction=1.0,
        box_px=np.array(BOX),
        camera_T_pad=Pose.from_rotvec([0.2, -0.4, 2.0], [3.1, 0.0, 0.0]),
        tag_corners_px=TAG,
        size_px=rng.uniform(8, 400),
        height_m=rng.uniform(1, 20),
        yaw_rad=0.3,
        carrier="box",
    )


def _write(folder: Path, count: int = 12) -> Path:
    """A data set of grey pictures, the box white."""
    rng = np.random.default_rng(1)
    for part in ("images/train", "images/val", "labels/train"):
        (folder / part).mkdir(parents=True)
    lines = [",".join(TRUTH_COLUMNS)]
    for index in range(count):
        row = truth_row(f"images/train/{index:06d}.jpg", "train", _truth(index, rng))
        lines.append(",".join(format_cell(row[name]) for name in TRUTH_COLUMNS))
        image = np.full((SIZE[1], SIZE[0], 3), 100, np.uint8)
        if row["present"]:
            image[50:200, 100:300] = 255
        path = folder / str(row["file"])
        assert cv2.imwrite(str(path), image)
        label_path(path).write_text(yolo_rows(boxes_of(row), *SIZE))
    (folder / "data.yaml").write_text(data_yaml(["pad"], ["train", "val"]))
    (folder / "truth.csv").write_text("\n".join(lines) + "\n")
    return folder


def _drawn(dataset: Path, index: int, width: int, height: int) -> np.ndarray:
    facts = read_facts(dataset)
    file = facts.files[index]
    return labelled(read_labels(dataset, [file])[file], facts.tag_corners_px[index], width, height)


def _near(image: np.ndarray, x: float, y: float, color: tuple[int, int, int]) -> float:
    """How far the nearest colour about a point is from `color`."""
    x0, y0 = round(x), round(y)
    part = image[max(y0 - 1, 0) : y0 + 2, max(x0 - 1, 0) : x0 + 2].astype(float)
    return float(np.abs(part - color).max(axis=2).min())


def test_labels_are_drawn_where_they_belong(tmp_path: Path) -> None:
    dataset = _write(tmp_path / "set")
    image = _drawn(dataset, 1, *SIZE)
    # two pixels outside the box on every side, and the tag's first corner marked
    for x, y in ((98, 125), (302, 125), (200, 48), (200, 202)):
        assert _near(image, x, y, YELLOW) < 30
    assert _near(image, 220, 120, SKY) < 30
    assert _near(image, 180, 100, VERMILLION) < 30
    assert _near(image, 220, 140, VERMILLION) > 100
    small = _drawn(dataset, 1, 320, 240)
    assert _near(small, 49 - 2, 62, YELLOW) < 60


def test_nothing_but_its_number_is_drawn_on_a_picture_without_pad(tmp_path: Path) -> None:
    image = _drawn(_write(tmp_path / "set"), 4, *SIZE)
    assert np.ptp(image[20:, 80:]) <= 4
    assert np.ptp(image[:14, :20]) > 100


def test_preview_writes_both_pictures_the_same_each_time(tmp_path: Path) -> None:
    dataset = _write(tmp_path / "set")
    first = write_preview(dataset, tmp_path / "a", count=6)
    second = write_preview(dataset, tmp_path / "b", count=6)
    assert [path.name for path in first] == ["preview.png", "statistics.png"]
    assert all(a.read_bytes() == b.read_bytes() for a, b in zip(first, second, strict=True))
    sheet = cv2.imread(str(first[0]))
    assert sheet is not None
    assert sheet.shape == (240, 6 * 322 - 2, 3)
    statistics = cv2.imread(str(first[1]))
    assert statistics is not None
    assert min(statistics.shape[:2]) >= 900


def test_preview_goes_beside_the_data_set_and_is_not_overwritten(tmp_path: Path) -> None:
    dataset = _write(tmp_path / "set", 2)
    preview, _ = write_preview(dataset)
    assert preview.parent == dataset
    with pytest.raises(OutputExistsError):
        write_preview(dataset)
    write_preview(dataset, overwrite=True)


def test_statistics_survive_a_data_set_without_any_pad(tmp_path: Path) -> None:
    dataset = _write(tmp_path / "set", 5)
    lines = (dataset / "truth.csv").read_text().splitlines()
    (dataset / "truth.csv").write_text("\n".join([lines[0], lines[5]]) + "\n")
    write_preview(dataset)
    assert all(np.isnan(row.coefficient) for row in dataset_correlations(dataset))


def test_facts_are_those_of_the_table(tmp_path: Path) -> None:
    facts = read_facts(_write(tmp_path / "set"))
    assert facts.present.tolist() == [i % 5 != 4 for i in range(12)]
    np.testing.assert_allclose(facts.centre_px[0], [CAMERA.cx + 0.1 * CAMERA.fx, CAMERA.cy - 0.2 * CAMERA.fy])
    np.testing.assert_allclose(facts.shares(np.array([[319.5, 119.5]])), [[0.5, 0.25]])
    assert np.isnan(facts.centre_px[4]).all()
    np.testing.assert_allclose(facts.blur_px, range(12))
    assert facts.signs[:3] == ((), ("text", "old-tyre"), ("text", "old-tyre") * 2)


@pytest.mark.parametrize("broken", ["picture", "label", "no split", "truth"])
def test_broken_data_sets_are_named_and_leave_nothing(tmp_path: Path, broken: str) -> None:
    dataset = _write(tmp_path / "set", 3)
    picture, label = dataset / "images/train/000001.jpg", dataset / "labels/train/000001.txt"
    if broken == "picture":
        picture.write_bytes(b"no picture")
    elif broken == "label":
        label.write_text("0 0.5 0.5 0.1\n")
    elif broken == "no split":
        (dataset / "data.yaml").write_text(data_yaml(["pad"], ["val", "train"]).replace("images/train", "images/val"))
    else:
        (dataset / "truth.csv").write_text((dataset / "truth.csv").read_text().splitlines()[0])
    with pytest.raises(InputError, match={"truth": "truth", "no split": "in no split"}.get(broken, "000001")):
        write_preview(dataset, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_no_data_set_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"truth\.csv"):
        write_preview(tmp_path)
    with pytest.raises(UsageError, match="0 pictures"):
        write_preview(tmp_path, count=0)


@pytest.mark.parametrize(("total", "count"), [(60, 60), (1120, 60), (61, 60), (3, 60), (5, 1)])
def test_evenly_spreads_over_all(total: int, count: int) -> None:
    chosen = evenly(total, count)
    steps = np.diff(chosen)
    assert len(chosen) == min(total, count)
    assert chosen[0] == 0
    assert chosen[-1] == (total - 1 if count > 1 else 0)
    assert not len(steps) or (steps.min() >= 1 and np.ptp(steps) <= 1)


def test_sheet_keeps_shapes_and_centres_pictures() -> None:
    tall, scale = fitted(np.full((400, 100, 3), 200, np.uint8), 50, 40)
    assert tall.shape == (40, 10, 3)
    assert scale == pytest.approx(0.1)
    sheet = contact_sheet([tall, tall, tall], 2, 1, 50, 40)
    assert sheet.shape == (40, 102, 3)
    assert (sheet[:, 20:30] == 200).all()
    assert (sheet[:, 72:82] == 200).all()
    assert (sheet[:, 30:72] < 200).all()
