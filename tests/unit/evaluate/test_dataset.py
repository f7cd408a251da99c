"""What a folder holds to evaluate with is found, once, and what is left out is said."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.errors import InputError, LandtoolError, UsageError
from landtool.evaluate.dataset import Clip, EvalDataset, Split, open_dataset
from landtool.io.coco import write_coco
from landtool.io.labels import LabelledBox, LabelledImage

BOX = "0 0.5 0.5 0.25 0.5\n"
CLASSES = "names: [pad]\n"


def picture(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), np.zeros((12, 16, 3), np.uint8))
    return path


def yolo(folder: Path, *splits: str, labels: str = BOX, data: bool = True) -> Path:
    """Write a picture a split, each with a label, and data.yaml; a split "" is images/ itself."""
    for split in splits:
        picture(folder / "images" / split / f"{split or 'it'}.png")
        label = folder / "labels" / split / f"{split or 'it'}.txt"
        label.parent.mkdir(parents=True, exist_ok=True)
        label.write_text(labels)
    if data:
        named = "".join(f"{split}: images/{split}\n" for split in splits)
        (folder / "data.yaml").write_text(CLASSES + named)
    return folder


def coco(file: Path, *pictures: str) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    boxes = (LabelledBox(0, 1.0, 1.0, 5.0, 5.0),)
    write_coco(file, ("pad",), lambda: [LabelledImage(Path(name), 16, 12, boxes) for name in pictures])
    return file


def clip(folder: Path, name: str, *beside: str) -> Path:
    """Write names only: to find a recording nothing of it is read."""
    folder.mkdir(parents=True, exist_ok=True)
    for end in ("truth.csv", *beside):
        (folder / f"{Path(name).stem}.{end}").write_text("x")
    (folder / name).write_text("x")
    return folder / name


def found(path: Path, split: Split = "auto") -> tuple[EvalDataset, list[str]]:
    dataset = open_dataset(path, split)
    return dataset, [f"{type(part).__name__} {part.name}" for part in dataset.parts]


class TestStills:
    def test_a_generated_dataset_knows_its_truth_and_pad(self, tmp_path: Path) -> None:
        folder = yolo(tmp_path / "set", "train", "val")
        for name in ("truth.csv", "pad.toml"):
            (folder / name).write_text("x")
        (part,) = open_dataset(folder).stills
        assert (part.truth, part.pad, part.folder) == (folder / "truth.csv", folder / "pad.toml", folder)
        assert part.names == ("pad",)
        assert len(part.images[0].boxes) == 1

    def test_a_plain_one_has_neither(self, tmp_path: Path) -> None:
        (part,) = open_dataset(yolo(tmp_path / "set", "train", "val")).stills
        assert part.truth is None
        assert part.pad is None

    @pytest.mark.parametrize(
        ("split", "taken"),
        [("auto", ["test"]), ("train", ["train"]), ("val", ["val"]), ("all", ["train", "val", "test"])],
    )
    def test_the_split_that_is_asked_for(self, split: Split, taken: list[str], tmp_path: Path) -> None:
        dataset = open_dataset(yolo(tmp_path / "set", "train", "val", "test"), split)
        assert [image.path.stem for image in dataset.stills[0].images] == taken
        left = "set: its split test was taken; train and val with --split all"
        assert dataset.notes == ((left,) if split == "auto" else ())

    def test_one_that_only_tests_needs_no_training_pictures(self, tmp_path: Path) -> None:
        dataset, parts = found(yolo(tmp_path / "set", "test"))
        assert parts == ["Stills set"]
        assert dataset.notes == ()

    def test_a_split_that_is_not_there_is_said(self, tmp_path: Path) -> None:
        dataset, parts = found(yolo(tmp_path / "set", "train", "val"), "test")
        assert parts == []
        assert dataset.notes == ("set: has no split test, it has train, val",)

    def test_a_folder_without_data_yaml(self, tmp_path: Path) -> None:
        dataset, parts = found(yolo(tmp_path / "set", "", data=False))
        assert parts == ["Stills set"]
        assert "set: it is not split: all its pictures count as test" in dataset.notes

    def test_missing_labels_are_said(self, tmp_path: Path) -> None:
        folder = yolo(tmp_path / "set", "test")
        shutil.rmtree(folder / "labels")
        dataset, parts = found(folder)
        assert parts == ["Stills set"]
        assert dataset.notes == ("set: nothing is labelled in its pictures (1)",)

    def test_a_folder_labels_that_is_missing_is_said(self, tmp_path: Path) -> None:
        shutil.rmtree(yolo(tmp_path / "set", "test", data=False) / "labels")
        dataset, parts = found(tmp_path / "set")
        assert parts == []
        note = "set: left out, images has no labels beside it (the folder labels, or a data.yaml)"
        assert dataset.notes == (note,)
        (tmp_path / "set/images.truth.csv").write_text("x")
        picture(tmp_path / "set/images/it.png")
        dataset, parts = found(tmp_path / "set")
        assert (parts, dataset.notes) == (["Clip images"], ())

    def test_missing_pictures_are_said(self, tmp_path: Path) -> None:
        folder = yolo(tmp_path / "set", "test")
        (folder / "images/test/test.png").unlink()
        dataset, parts = found(folder)
        assert parts == []
        assert dataset.notes == ("set: holds no pictures",)

    def test_the_data_yaml_itself(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(yolo(tmp_path / "set", "test"))
        assert found(Path("data.yaml"))[1] == ["Stills set"]

    @pytest.mark.parametrize(
        ("labels", "said"),
        [("7 0.5 0.5 0.2 0.2\n", r"line 1: class 7 is none of the 1"), ("0 0.5\n", "line 1: 2 numbers where 5")],
    )
    def test_a_wrong_label_names_file_and_line(self, labels: str, said: str, tmp_path: Path) -> None:
        with pytest.raises(InputError, match=rf"test\.txt: {said}"):
            open_dataset(yolo(tmp_path / "set", "test", labels=labels))

    def test_a_data_yaml_without_pictures(self, tmp_path: Path) -> None:
        (tmp_path / "data.yaml").write_text(CLASSES)
        with pytest.raises(InputError, match=r"data\.yaml: names no pictures: it has none of train, val, test"):
            open_dataset(tmp_path)


class TestCoco:
    def test_a_json(self, tmp_path: Path) -> None:
        picture(tmp_path / "a.png")
        (part,) = open_dataset(coco(tmp_path / "boxes.json", "a.png")).stills
        assert (part.name, part.names, part.images[0].path) == ("boxes", ("pad",), tmp_path / "a.png")

    @pytest.mark.parametrize(("split", "taken"), [("auto", ["val"]), ("train", ["train"]), ("all", ["train", "val"])])
    @pytest.mark.parametrize("name", ["{}.json", "instances_{}.json", "instances_{}2017.json"])
    def test_a_folder_never_takes_training_pictures_unasked(
        self, name: str, split: Split, taken: list[str], tmp_path: Path
    ) -> None:
        for given in ("train", "val"):
            picture(tmp_path / "set/images" / f"{given}.png")
            coco(tmp_path / "set/annotations" / name.format(given), f"{given}.png")
        dataset = open_dataset(tmp_path / "set", split)
        assert [image.path.stem for part in dataset.stills for image in part.images] == taken
        assert [note for note in dataset.notes if "train with --split all" in note] == list(dataset.notes)
        assert bool(dataset.notes) is (split == "auto")

    def test_names_that_tell_no_split(self, tmp_path: Path) -> None:
        for name in ("left", "right"):
            picture(tmp_path / "set/images" / f"{name}.png")
            coco(tmp_path / "set/annotations" / f"{name}.json", f"{name}.png")
        assert found(tmp_path / "set")[1] == ["Stills set/left", "Stills set/right"]
        dataset, parts = found(tmp_path / "set", "val")
        assert len(parts) == 2
        assert dataset.notes == ("set: which split its files are is not known, all are taken",)

    def test_one_without_pictures_is_said(self, tmp_path: Path) -> None:
        dataset, parts = found(coco(tmp_path / "none.json"))
        assert parts == []
        assert dataset.notes == ("none: holds no pictures",)

    @pytest.mark.parametrize(("there", "more"), [((), ", and 1 more"), (("a.png",), "")])
    def test_one_away_from_its_pictures(self, there: tuple[str, ...], more: str, tmp_path: Path) -> None:
        for name in there:
            picture(tmp_path / name)
        file = coco(tmp_path / "bare.json", "a.png", "b.png")
        lost = tmp_path / ("b.png" if there else "a.png")
        with pytest.raises(InputError) as caught:
            open_dataset(file)
        assert str(caught.value).startswith(f"{file}: names a picture that is not there: {lost}{more}; put the json")

    def test_the_same_boxes_as_yolo_and_coco_count_once(self, tmp_path: Path) -> None:
        coco(yolo(tmp_path / "set", "test") / "annotations/test.json", "images/test/test.png")
        assert found(tmp_path / "set")[1] == ["Stills set"]


class TestClips:
    def test_what_lies_beside_is_taken(self, tmp_path: Path) -> None:
        clip(tmp_path, "a.mp4", "camera.yaml", "pad.toml", "ego.csv")
        clip(tmp_path, "b.mcap")
        a, b = open_dataset(tmp_path).clips
        beside = [tmp_path / f"a.{end}" for end in ("truth.csv", "camera.yaml", "pad.toml", "ego.csv")]
        assert a == Clip("a", tmp_path / "a.mp4", *beside)
        assert b == Clip("b", tmp_path / "b.mcap", tmp_path / "b.truth.csv", None, None, None)

    def test_a_folder_of_pictures_is_a_recording(self, tmp_path: Path) -> None:
        picture(tmp_path / "a/0.png")
        (tmp_path / "a.truth.csv").write_text("x")
        assert open_dataset(tmp_path).clips[0].path == tmp_path / "a"

    def test_of_a_video_and_a_log_of_one_landing_the_video(self, tmp_path: Path) -> None:
        clip(tmp_path, "a.mp4")
        clip(tmp_path, "a.mcap")
        dataset, parts = found(tmp_path)
        assert parts == ["Clip a"]
        assert dataset.clips[0].path.name == "a.mp4"
        assert dataset.notes == ("a.mcap: left out, a.mp4 shows the same landing",)
        assert open_dataset(tmp_path / "a.mcap").clips[0].path.name == "a.mcap"

    def test_what_is_alone_is_said(self, tmp_path: Path) -> None:
        (tmp_path / "a.mp4").write_text("x")
        (tmp_path / "b.truth.csv").write_text("x")
        dataset, parts = found(tmp_path)
        assert parts == []
        assert set(dataset.notes) == {
            "a.mp4: left out, it has no truth beside it (a.truth.csv)", "b.truth.csv: no recording beside it",
        }  # fmt: skip

    def test_names_of_any_letters(self, tmp_path: Path) -> None:
        name = 'landing\'s "7" ü 着陸.mp4'
        clip(tmp_path, name, "camera.yaml")
        (part,) = open_dataset(tmp_path).clips
        assert part.path == tmp_path / name
        assert part.camera is not None


class TestFog:
    def test_a_generated_dataset_with_twins_is_both(self, tmp_path: Path) -> None:
        folder = yolo(tmp_path / "set", "val", "test")
        picture(folder / "clear/val/val.png")
        dataset, parts = found(folder)
        assert parts == ["Stills set", "FogPairs set in fog"]
        assert [pair.name for pair in dataset.fog_pairs[0].pairs] == ["images/val/val.png"]

    def test_hazy_ones_of_their_own(self, tmp_path: Path) -> None:
        picture(tmp_path / "set/hazy/1_0.8.png")
        picture(tmp_path / "set/clear/1.png")
        assert found(tmp_path / "set")[1] == ["FogPairs set"]

    def test_a_twin_that_is_lost_is_no_picture_less(self, tmp_path: Path) -> None:
        folder = yolo(tmp_path / "set", "val", "test")
        picture(folder / "clear/val/val.png")
        (folder / "truth.csv").write_text("file,beta_per_m\nimages/val/val.png,0.1\nimages/test/test.png,0.2\n")
        with pytest.raises(InputError, match=r"test\.png: has no twin in clear air"):
            open_dataset(folder)


class TestSeveral:
    def test_a_folder_of_several_as_deep_as_it_goes(self, tmp_path: Path) -> None:
        yolo(tmp_path / "all/labelled", "test")
        clip(tmp_path / "all/flown/deep", "a.mp4")
        picture(tmp_path / "all/fog/fog_1.png")
        picture(tmp_path / "all/fog/clear_1.png")
        clip(tmp_path / "all", "top.mkv")
        clip(tmp_path / "all/.hidden", "h.mp4")
        dataset, parts = found(tmp_path / "all")
        assert parts == ["Clip flown/deep/a", "FogPairs fog", "Stills labelled", "Clip top"]
        assert [len(kind) for kind in (dataset.stills, dataset.clips, dataset.fog_pairs)] == [1, 2, 1]

    def test_what_landtool_made_of_data_is_no_data(self, tmp_path: Path) -> None:
        clip(tmp_path, "a.mp4")
        for made, mark in (("runs/eval", "metrics.json"), ("runs/track/a", "run.json")):
            clip(tmp_path / made, "annotated.mp4")
            (tmp_path / made / mark).write_text("{}")
        dataset, parts = found(tmp_path)
        assert parts == ["Clip a"]
        assert dataset.notes == ()

    def test_links_are_followed_and_never_round_in_circles(self, tmp_path: Path) -> None:
        clip(tmp_path / "x", "a.mp4")
        clip(tmp_path / "y", "b.mp4")
        (tmp_path / "x/up").symlink_to("..")
        (tmp_path / "x/self").symlink_to(".")
        (tmp_path / "y/other").symlink_to("../x")
        assert found(tmp_path)[1] == ["Clip x/a", "Clip y/b", "Clip y/other/a"]

    def test_an_empty_folder_holds_nothing(self, tmp_path: Path) -> None:
        assert found(tmp_path)[1] == []


@pytest.mark.parametrize(
    ("name", "kind", "said"),
    [
        ("none", UsageError, "none: does not exist"),
        ("a.mp4", UsageError, r"a\.mp4: has no truth beside it \(a\.truth\.csv\); give a folder of"),
        ("b.truth.csv", UsageError, r"b\.truth\.csv: is a truth; give the recording it is about"),
        ("c.ego.csv", UsageError, r"c\.ego\.csv: is no recording, data\.yaml or COCO json; give a folder of"),
        ("a.json", InputError, r"a\.json: has no list 'categories'"),
        ("a.yaml", InputError, r"a\.yaml: has no 'names'"),
        ("dead", UsageError, "dead: is a link to nothing"),
    ],
)
def test_no_dataset(name: str, kind: type[LandtoolError], said: str, tmp_path: Path) -> None:
    for file, text in (("a.mp4", "x"), ("b.truth.csv", "x"), ("c.ego.csv", "x"), ("a.json", "{}"), ("a.yaml", "a: 1")):
        (tmp_path / file).write_text(text)
    (tmp_path / "dead").symlink_to("nothing")
    with pytest.raises(kind, match=said):
        open_dataset(tmp_path / name)


class TestDigest:
    def test_it_is_that_of_the_content_wherever_it_lies(self, tmp_path: Path) -> None:
        clip(yolo(tmp_path / "one", "test"), "a.mp4", "ego.csv")
        shutil.copytree(tmp_path / "one", tmp_path / "moved")
        assert open_dataset(tmp_path / "one").digest == open_dataset(tmp_path / "moved").digest

    @pytest.mark.parametrize("file", ["a.mp4", "a.truth.csv", "a.ego.csv", "labels/test/test.txt"])
    def test_every_file_that_counts_changes_it(self, file: str, tmp_path: Path) -> None:
        clip(yolo(tmp_path, "test"), "a.mp4", "ego.csv")
        before = open_dataset(tmp_path).digest
        (tmp_path / "notes.txt").write_text("nothing to do with it")
        assert open_dataset(tmp_path).digest == before
        (tmp_path / file).write_text("0 0.5 0.5 0.25 0.25\n")
        assert open_dataset(tmp_path).digest != before

    def test_yolo_and_coco_of_one_truth_are_one(self, tmp_path: Path) -> None:
        yolo(tmp_path / "one", "", data=False)
        image = open_dataset(tmp_path / "one").stills[0].images[0]
        write_coco(
            tmp_path / "one/set.json", ("pad",), lambda: [LabelledImage(Path("images/it.png"), 16, 12, image.boxes)]
        )
        assert open_dataset(tmp_path / "one").digest == open_dataset(tmp_path / "one/set.json").digest
