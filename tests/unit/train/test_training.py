"""The loop: what it writes, how it goes on after an interruption, and what it refuses."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="torch is not installed: pip install 'landtool[train]'")

from landtool.darknet.cfg import parse_cfg, read_cfg
from landtool.darknet.checkpoint import read_checkpoint
from landtool.darknet.weights import read_weights, weights_bytes
from landtool.errors import InputError, OutputExistsError, UsageError
from landtool.train.results import parse_results
from landtool.train.settings import TrainSettings, darknet_recipe
from landtool.train.training import Step, TrainingError, train
from tests.unit.train.small_training import dataset, settings


class KilledError(Exception):
    """The power failed."""


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return dataset(tmp_path / "data")


def killer(at: int) -> object:
    def on_step(step: Step) -> None:
        if step.iteration == at:
            raise KilledError

    return on_step


def test_a_training_writes_all_it_promises(data: Path, tmp_path: Path) -> None:
    steps: list[int] = []
    made = train(str(data), tmp_path / "run", settings(tmp_path), on_step=lambda s: steps.append(s.iteration))
    run = tmp_path / "run"
    assert steps == [1, 2, 3, 4, 5, 6]
    assert {p.relative_to(run).as_posix() for p in run.rglob("*") if p.is_file()} == {
        "curves.png",
        "network.cfg",
        "results.csv",
        "run.json",
        "training.json",
        "validation.png",
        "weights/best.landtool",
        "weights/best.weights",
        "weights/last.landtool",
    }
    rows = parse_results((run / "results.csv").read_text(encoding="utf-8"))
    assert [row.iteration for row in rows] == [3, 6]
    assert [row.iteration for row in made.rows] == [3, 6]
    network, best, names = read_checkpoint(run / "weights" / "best.landtool")
    assert names == ("pad",)
    assert best.seen == 4 * made.best_row.iteration
    darknet = read_weights(run / "weights" / "best.weights", read_cfg(run / "network.cfg"))
    assert weights_bytes(darknet, network) == weights_bytes(best, network)


@pytest.mark.parametrize("at", [1, 3, 4])
def test_an_interrupted_training_ends_with_the_same_weights(data: Path, tmp_path: Path, at: int) -> None:
    asked = settings(tmp_path, save_minutes=0.0)
    train(str(data), tmp_path / "whole", asked)
    with pytest.raises(KilledError):
        train(str(data), tmp_path / "cut", asked, on_step=killer(at))  # type: ignore[arg-type]
    said: list[str] = []
    train(str(data), tmp_path / "cut", asked, tell=said.append)
    # a step is saved after it was told of
    assert any(f"going on after iteration {at - 1}" in text for text in said) == (at > 1)
    for name in ("best.landtool", "last.landtool"):
        whole, cut = (_arrays(tmp_path / run / "weights" / name) for run in ("whole", "cut"))
        assert whole.keys() == cut.keys()
        assert all(whole[key] == cut[key] for key in whole if key != "progress"), name
    whole_rows, cut_rows = (
        parse_results((tmp_path / run / "results.csv").read_text(encoding="utf-8")) for run in ("whole", "cut")
    )
    assert [replace(row, seconds=0.0) for row in whole_rows] == [replace(row, seconds=0.0) for row in cut_rows]


def test_other_settings_do_not_go_on_with_it(data: Path, tmp_path: Path) -> None:
    asked = settings(tmp_path, save_minutes=0.0)
    with pytest.raises(KilledError):
        train(str(data), tmp_path / "run", asked, on_step=killer(3))  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="unfinished training with other settings"):
        train(str(data), tmp_path / "run", replace(asked, seed=1))
    # how many threads work on it is no other training
    train(str(data), tmp_path / "run", replace(asked, threads=2))


def test_a_finished_one_is_kept_and_replaced_on_request(data: Path, tmp_path: Path) -> None:
    train(str(data), tmp_path / "run", settings(tmp_path, iterations=1))
    with pytest.raises(OutputExistsError):
        train(str(data), tmp_path / "run", settings(tmp_path, iterations=1))
    made = train(str(data), tmp_path / "run", settings(tmp_path, iterations=2), overwrite=True)
    assert [row.iteration for row in made.rows] == [2]


def test_somebody_elses_folder_is_left_alone(data: Path, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "thesis.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(OutputExistsError):
        train(str(data), tmp_path / "run", settings(tmp_path))
    with pytest.raises(UsageError, match="did not write"):
        train(str(data), tmp_path / "run", settings(tmp_path), overwrite=True)
    assert [p.name for p in (tmp_path / "run").iterdir()] == ["thesis.txt"]


def test_a_loss_that_is_no_number_ends_it(data: Path, tmp_path: Path) -> None:
    cfg = parse_cfg(settings(tmp_path).cfg.read_text(encoding="utf-8"))  # type: ignore[union-attr]
    numbers = np.full(cfg.parameters, 3e38, np.float32)
    start = tmp_path / "huge.weights"
    start.write_bytes(np.array([0, 2, 5, 0, 0], "<i4").tobytes() + numbers.tobytes())
    with pytest.raises(TrainingError, match="no number any more at iteration 1"):
        train(str(data), tmp_path / "run", settings(tmp_path, weights=start))


def test_a_backbone_is_a_start(data: Path, tmp_path: Path) -> None:
    train(str(data), tmp_path / "first", settings(tmp_path, iterations=2))
    network = read_cfg(tmp_path / "first" / "network.cfg")
    whole = (tmp_path / "first" / "weights" / "best.weights").read_bytes()
    backbone = tmp_path / "first.conv.2"
    backbone.write_bytes(whole[: 20 + 4 * sum(layer.parameters for _, layer in network.convolutions[:2])])
    made = train(str(data), tmp_path / "run", settings(tmp_path, weights=backbone, iterations=1, learning_rate=1e-7))
    first, then = (read_checkpoint(tmp_path / run / "weights" / "best.landtool")[1] for run in ("first", "run"))
    assert made.rows
    assert np.allclose(first.layers[1].kernels, then.layers[1].kernels, atol=1e-5)
    assert not np.allclose(first.layers[2].kernels, then.layers[2].kernels, atol=1e-3)


@pytest.mark.parametrize("split", ["train", "val"])
def test_an_empty_set_is_refused(data: Path, tmp_path: Path, split: str) -> None:
    for path in (data.parent / "images" / split).iterdir():
        path.unlink()
    with pytest.raises(InputError, match=f"its {split} set is empty"):
        train(str(data), tmp_path / "run", settings(tmp_path))


def test_a_set_without_labels_is_refused(data: Path, tmp_path: Path) -> None:
    for path in (data.parent / "labels" / "train").iterdir():
        path.unlink()
    with pytest.raises(InputError, match="its train set labels no target"):
        train(str(data), tmp_path / "run", settings(tmp_path))


@pytest.mark.parametrize(
    ("row", "said"),
    [("1 0.5 0.5 0.2 0.2", "class 1 is none"), ("0 0.5 0.5 2 0.2", "outside the picture"), ("0 x 0 0 0", "no number")],
)
def test_labels_that_are_wrong_are_named(data: Path, tmp_path: Path, row: str, said: str) -> None:
    (data.parent / "labels" / "train" / "3.txt").write_text(row, encoding="utf-8")
    with pytest.raises(InputError, match=said) as caught:
        train(str(data), tmp_path / "run", settings(tmp_path))
    assert "3.txt" in str(caught.value)
    assert not (tmp_path / "run").exists()


def test_a_picture_cut_in_half_is_named(data: Path, tmp_path: Path) -> None:
    for path in (data.parent / "images" / "train").iterdir():
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match="png"):
        train(str(data), tmp_path / "run", settings(tmp_path))


def test_a_network_of_other_classes_is_refused(data: Path, tmp_path: Path) -> None:
    data.write_text("train: images/train\nval: images/val\nnames: [pad, sign]\n", encoding="utf-8")
    with pytest.raises(UsageError, match="for 1 classes, the data name 2"):
        train(str(data), tmp_path / "run", settings(tmp_path))


def test_anchors_can_come_from_the_labels(data: Path, tmp_path: Path) -> None:
    said: list[str] = []
    train(str(data), tmp_path / "run", settings(tmp_path, anchors="kmeans", iterations=1), tell=said.append)
    found = [head.anchors for _, head in read_cfg(tmp_path / "run" / "network.cfg").heads]
    assert "anchors by k-means" in said[0]
    assert all(10.0 < side < 32.0 for anchors in found for anchor in anchors for side in anchor)


def test_the_checkpoint_of_another_network_does_not_go_on(data: Path, tmp_path: Path) -> None:
    asked = settings(tmp_path, save_minutes=0.0)
    with pytest.raises(KilledError):
        train(str(data), tmp_path / "run", asked, on_step=killer(3))  # type: ignore[arg-type]
    last = tmp_path / "run" / "weights" / "last.landtool"
    last.write_bytes(last.read_bytes()[:1000])
    with pytest.raises(InputError, match="no whole checkpoint"):
        train(str(data), tmp_path / "run", asked)


def test_darknets_recipe_trains_whole_stretched_pictures() -> None:
    recipe = darknet_recipe(TrainSettings(iterations=7, seed=3))
    assert (recipe.loss, recipe.optimizer, recipe.schedule, recipe.whole) == ("darknet", "sgd", "steps", 1.0)
    assert (recipe.hue, recipe.saturation, recipe.exposure) == (0.1, 1.5, 1.5)
    assert (recipe.size, recipe.iterations, recipe.seed) == (None, 7, 3)


@pytest.mark.parametrize("change", [{"batch": 0}, {"mosaic": 1.5}, {"learning_rate": -1.0}, {"sides": ()}])
def test_impossible_settings_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        TrainSettings(**change)  # type: ignore[arg-type]


def _arrays(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name.removesuffix(".npy"): archive.read(name) for name in archive.namelist()}


def test_a_training_without_a_data_set_draws_its_pictures(tmp_path: Path) -> None:
    asked = settings(tmp_path, size=(64, 64), iterations=2, first_pictures=8, fresh_pictures=1.0, validate_on=4)
    made = train("generate:3", tmp_path / "run", replace(asked, whole=1.0))
    assert [row.iteration for row in made.rows] == [2]
    assert "generate:3" in (tmp_path / "run" / "training.json").read_text(encoding="utf-8")
