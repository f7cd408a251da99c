from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.errors import InputError, LandtoolError, OutputError, OutputExistsError, UsageError
from landtool.io.calibration import read_camera
from landtool.io.coco import read_coco
from landtool.io.labels import read_yolo
from landtool.io.run_record import sha256_of
from landtool.io.tables import read_rows
from landtool.pad import PadSpec
from landtool.synth.dataset import TRUTH_COLUMNS, DatasetRequest, Progress, write_dataset
from landtool.synth.dataset.work import Draw
from tests.limits import files_of_at_most
from tests.unit.synth.dataset import plain
from tests.unit.synth.dataset.plain import PlainDomain

N = 30
SIZE = (96, 64)


def request(n: int = N, domain: PlainDomain | None = None, seed: int = 3) -> DatasetRequest:
    return DatasetRequest(n, seed, SIZE, (0.7, 0.2, 0.1), domain or PlainDomain(), PadSpec())  # type: ignore[arg-type]


def write(folder: Path, asked: DatasetRequest | None = None, *, draw: Draw = plain.draw, jobs: int = 1) -> None:  # type: ignore[assignment]
    write_dataset(asked or request(), folder, jobs=jobs, draw=draw, preview=False)


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "set"
    write(folder)
    return folder


class TestLayout:
    def test_yolo_coco_and_truth_agree(self, dataset: Path) -> None:
        yolo = read_yolo(dataset / "data.yaml")
        assert yolo.names == ("pad",)
        rows = {str(row["file"]): row for row in read_rows(dataset / "truth.csv", TRUTH_COLUMNS)}
        assert len(rows) == N
        assert Counter(row["split"] for row in rows.values()) == {"train": 21, "val": 6, "test": 3}
        for split in ("train", "val", "test"):
            coco = {image.path: image for image in read_coco(dataset / f"annotations/{split}.json", dataset).images}
            images = list(yolo.read(split))
            assert len(images) == len(coco)
            for image in images:
                row = rows[image.path.relative_to(dataset).as_posix()]
                assert row["split"] == split
                assert len(image.boxes) == row["present"] == len(coco[image.path].boxes)
                for name in ("x_min_px", "y_min_px", "x_max_px", "y_max_px") if image.boxes else ():
                    assert getattr(image.boxes[0], name) == pytest.approx(row[name], abs=1e-4)
                    assert getattr(coco[image.path].boxes[0], name) == pytest.approx(row[name], abs=1e-4)

    def test_a_label_is_where_the_white_is(self, dataset: Path) -> None:
        image = next(image for image in read_yolo(dataset / "data.yaml").read("train") if image.boxes)
        picture = cv2.imread(str(image.path), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        box = image.boxes[0]
        white = picture[round(box.y_min_px + 0.5) : round(box.y_max_px + 0.5), :][
            :, round(box.x_min_px + 0.5) : round(box.x_max_px + 0.5)
        ]
        assert white.shape == (10, 30)
        assert np.median(white) > 230

    def test_a_background_has_an_empty_label(self, dataset: Path) -> None:
        labels = {path.stem: path.read_text() for path in dataset.glob("labels/*/*.txt")}
        assert sorted(labels) == [f"{i:06d}" for i in range(N)]
        assert [i for i in range(N) if not labels[f"{i:06d}"]] == list(range(0, N, 3))

    def test_what_is_not_known_is_empty(self, dataset: Path) -> None:
        without, with_pad = list(read_rows(dataset / "truth.csv", TRUTH_COLUMNS))[:2]
        for name in ("x_min_px", "camera_T_pad_x_m", "x0_px", "height_m", "size_px", "airlight_b", "carrier"):
            assert without[name] is None, name
            assert with_pad[name] is not None, name
        assert without["signs"] == "no-H ring"
        assert with_pad["applied"] == "jpeg=90 blur=motion"
        assert [with_pad[f"camera_T_pad_{name}"] for name in ("x_m", "y_m", "z_m")] == [0.1, 0.2, 3.0]
        assert [with_pad[name] for name in ("x0_px", "y0_px", "x3_px", "y3_px")] == [30, 12, 30, 16]

    def test_the_manifest_tells_all(self, dataset: Path) -> None:
        manifest = json.loads((dataset / "manifest.json").read_text())
        files = {name for name in content(dataset) if name != "manifest.json"}
        assert set(manifest["files"]) == files
        assert all(manifest["files"][name] == sha256_of(dataset / name) for name in files)
        assert (manifest["seed"], manifest["n"], manifest["size"]) == (3, N, [96, 64])
        assert manifest["domain"]["hfov_deg"] == [50.0, 100.0]
        assert manifest["versions"]["numpy"] == np.__version__

    def test_camera_and_pad_files(self, dataset: Path) -> None:
        camera = read_camera(dataset / "camera.yaml")
        assert (camera.width, camera.height) == SIZE
        assert 2 * np.degrees(np.arctan(48.0 / camera.fx)) == pytest.approx(75.0)
        assert "75 degrees" in camera.assumed
        assert PadSpec.read(dataset / "pad.toml") == PadSpec()

    def test_no_place_of_this_machine_is_in_it(self, dataset: Path) -> None:
        for name, data in content(dataset).items():
            assert str(dataset.parent).encode() not in data, name

    def test_two_splits_are_enough(self, tmp_path: Path) -> None:
        write(tmp_path / "set", replace(request(5), split=(0.8, 0.2)))
        assert list(read_yolo(tmp_path / "set/data.yaml").splits) == ["train", "val"]
        assert not (tmp_path / "set/annotations/test.json").exists()


class TestBytes:
    def test_the_same_with_any_jobs(self, dataset: Path, tmp_path: Path) -> None:
        write(tmp_path / "set", jobs=3)
        assert content(tmp_path / "set") == content(dataset)

    def test_another_seed_is_another_dataset(self, dataset: Path, tmp_path: Path) -> None:
        write(tmp_path / "set", request(seed=4))
        other, mine = content(tmp_path / "set"), content(dataset)
        pictures = [{Path(k).name: v for k, v in c.items() if k.endswith(".jpg")} for c in (other, mine)]
        assert pictures[0].keys() == pictures[1].keys()
        assert all(pictures[0][name] != pictures[1][name] for name in pictures[0])

    def test_more_pictures_begin_with_the_same(self, dataset: Path, tmp_path: Path) -> None:
        write(tmp_path / "set", request(N + 5))
        mine, more = ({p.name: p.read_bytes() for p in d.rglob("*.jpg")} for d in (dataset, tmp_path / "set"))
        assert len(more) == N + 5
        assert all(more[name] == data for name, data in mine.items())


class TestTwins:
    def test_pictures_in_fog_have_one_and_stay_as_they_are(self, dataset: Path, tmp_path: Path) -> None:
        asked = replace(request(), clear=True)
        summary = write_dataset(asked, tmp_path / "set", draw=plain.draw, preview=False)  # type: ignore[arg-type]
        mine, made = content(dataset), content(tmp_path / "set")
        foggy = {row["file"] for row in read_rows(dataset / "truth.csv", TRUTH_COLUMNS) if row["beta_per_m"]}
        twins = {name.replace("images/", "clear/", 1) for name in map(str, foggy)}
        assert 0 < len(twins) == summary.twins < N
        assert made.keys() - mine.keys() == twins
        assert all(made[name] == data for name, data in mine.items() if name != "manifest.json")
        manifest = json.loads(made["manifest.json"])
        assert manifest["clear"] is True
        assert all(manifest["files"][name] == sha256_of(tmp_path / "set" / name) for name in twins)

    def test_a_lost_one_is_drawn_again(self, tmp_path: Path) -> None:
        asked = replace(request(domain=PlainDomain(trouble_at=9)), clear=True)
        with pytest.raises(KeyboardInterrupt):
            write(tmp_path / "set", asked, draw=plain.draw_until_trouble)  # type: ignore[arg-type]
        (work,) = tmp_path.iterdir()
        lost, cut = sorted(work.rglob("clear/*/*.jpg"))[:2]
        lost.unlink()
        cut.write_bytes(cut.read_bytes()[:100])
        write(tmp_path / "set", asked)
        write(tmp_path / "other", asked)
        assert content(tmp_path / "set") == content(tmp_path / "other")

    def test_without_fog_there_is_none(self, tmp_path: Path) -> None:
        summary = write_dataset(replace(request(1), clear=True), tmp_path / "set", draw=plain.draw, preview=False)  # type: ignore[arg-type]
        assert summary.twins == 0
        assert not (tmp_path / "set/clear").exists()

    def test_overwriting_knows_them_as_its_own(self, tmp_path: Path) -> None:
        write(tmp_path / "set", replace(request(4), clear=True))
        write_dataset(request(4), tmp_path / "set", overwrite=True, preview=False, draw=plain.draw)  # type: ignore[arg-type]
        assert not (tmp_path / "set/clear").exists()


class TestTrouble:
    def test_an_interrupted_run_goes_on(self, dataset: Path, tmp_path: Path) -> None:
        drawn = tmp_path / "drawn.txt"
        domain = PlainDomain(drawn=str(drawn), trouble_at=17)
        folder = tmp_path / "out" / "set"
        with pytest.raises(KeyboardInterrupt):
            write(folder, request(domain=domain), draw=plain.draw_until_trouble)  # type: ignore[arg-type]
        assert not folder.exists()
        assert len(drawn.read_text().split()) == 17
        kept: list[tuple[int, int]] = []
        progress = Progress(start=lambda total, done: kept.append((total, done)))
        summary = write_dataset(request(domain=domain), folder, draw=plain.draw, preview=False, progress=progress)  # type: ignore[arg-type]
        assert kept == [(N, 17)]
        assert (summary.images, summary.kept, summary.with_pad) == (N, 17, 20)
        assert sorted(map(int, drawn.read_text().split())) == list(range(N))  # none of them twice
        assert [path.name for path in folder.parent.iterdir()] == ["set"]
        # all but the manifest, which names the domain, is as in one go
        mine, other = content(folder), content(dataset)
        assert {k: v for k, v in mine.items() if k != "manifest.json"} == {
            k: v for k, v in other.items() if k != "manifest.json"
        }

    def test_a_damaged_leftover_is_drawn_again(self, dataset: Path, tmp_path: Path) -> None:
        folder = tmp_path / "set"
        with pytest.raises(KeyboardInterrupt):
            write(folder, request(domain=PlainDomain(trouble_at=9)), draw=plain.draw_until_trouble)  # type: ignore[arg-type]
        (work,) = tmp_path.iterdir()
        pictures = sorted(work.rglob("*.jpg"))
        pictures[0].write_bytes(b"")
        pictures[1].write_bytes(pictures[1].read_bytes()[:-1] + b"x")
        (work / "notes/5.json").write_text('{"row": ')
        (work / "whole/.landtool-0123abcd.png").write_text("of a killed run")
        write(folder, request(domain=PlainDomain(trouble_at=9)))
        mine, other = content(folder), content(dataset)
        assert mine.keys() == other.keys()
        assert all(mine[name] == other[name] for name in mine if name != "manifest.json")

    def test_another_request_does_not_take_the_leftovers(self, dataset: Path, tmp_path: Path) -> None:
        with pytest.raises(KeyboardInterrupt):
            write(tmp_path / "set", request(seed=9, domain=PlainDomain(trouble_at=9)), draw=plain.draw_until_trouble)  # type: ignore[arg-type]
        write(tmp_path / "set")
        assert content(tmp_path / "set") == content(dataset)

    @pytest.mark.parametrize("jobs", [1, 2])
    def test_an_error_of_a_picture_is_told_as_it_is(self, tmp_path: Path, jobs: int) -> None:
        with pytest.raises(InputError, match=r"^photo\.jpg: is bad; remove it$"):
            write(tmp_path / "set", request(domain=PlainDomain(trouble_at=20)), draw=plain.draw_or_fail, jobs=jobs)  # type: ignore[arg-type]
        assert not (tmp_path / "set").exists()

    def test_a_process_that_is_killed(self, tmp_path: Path) -> None:
        with pytest.raises(LandtoolError, match=r"was killed; .*fewer --jobs"):
            write(tmp_path / "set", request(domain=PlainDomain(trouble_at=20)), draw=plain.draw_and_die, jobs=2)  # type: ignore[arg-type]
        assert not (tmp_path / "set").exists()

    def test_a_full_disk(self, tmp_path: Path) -> None:
        with files_of_at_most(1000), pytest.raises(OutputError, match=r"set: cannot be written: File too large; "):
            write(tmp_path / "set")
        assert list(tmp_path.iterdir()) == []

    def test_what_is_there_stays(self, tmp_path: Path) -> None:
        folder = tmp_path / "set"
        folder.mkdir()
        (folder / "mine.txt").write_text("mine")
        with pytest.raises(OutputExistsError):
            write(folder)
        with pytest.raises(UsageError, match="did not write"):
            write_dataset(request(), folder, overwrite=True, preview=False, draw=plain.draw)  # type: ignore[arg-type]
        assert content(folder) == {"mine.txt": b"mine"}
        assert [path.name for path in tmp_path.iterdir()] == ["set"]

    def test_overwriting_replaces_a_dataset(self, dataset: Path, tmp_path: Path) -> None:
        write(tmp_path / "set", request(4))
        write_dataset(request(), tmp_path / "set", overwrite=True, preview=False, draw=plain.draw)  # type: ignore[arg-type]
        assert content(tmp_path / "set") == content(dataset)

    def test_no_jobs(self, tmp_path: Path) -> None:
        with pytest.raises(UsageError, match="0 jobs cannot work"):
            write(tmp_path / "set", jobs=0)


def test_overwriting_throws_nothing_away_but_a_dataset(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    write_dataset(request(), folder, preview=False, draw=plain.draw)  # type: ignore[arg-type]
    (folder / "runs").mkdir()
    (folder / "runs" / "notes.txt").write_text("mine")
    with pytest.raises(UsageError, match=r"holds runs/notes\.txt, which is not of the dataset; move it away"):
        write_dataset(request(), folder, overwrite=True, preview=False, draw=plain.draw)  # type: ignore[arg-type]
    assert (folder / "runs" / "notes.txt").read_text() == "mine"
    (folder / "runs" / "notes.txt").unlink()
    (folder / "preview.png").write_bytes(b"as generate preview writes it")
    write_dataset(request(), folder, overwrite=True, preview=False, draw=plain.draw)  # type: ignore[arg-type]
    assert not (folder / "preview.png").exists()
