from __future__ import annotations

import hashlib
import json
import math
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import landtool
from landtool.camera import Camera
from landtool.errors import InputError, OutputExistsError
from landtool.io.run_record import Counts, HashedFile, RunRecord, StageTime, installed_versions, sha256_of, write_run

COUNTS = Counts(declared=None, decoded=10, damaged=1, lost=2, skipped=3, written=10)


def record(**changes: object) -> RunRecord:
    values: dict[str, object] = {
        "command": "track",
        "config": {"horizon_s": 0.5},
        "inputs": (HashedFile("clip.mp4", "ab"),),
        "counts": COUNTS,
        "exit_code": 3,
    }
    return RunRecord(**{**values, **changes})  # type: ignore[arg-type]


def test_says_everything(tmp_path: Path) -> None:
    timings = {"tags": StageTime(0.5, 10), "pose": StageTime()}
    path = write_run(
        tmp_path,
        record(timings=timings, seed=7, model=HashedFile("m.onnx", "cd"), notes=("cut",), verdict={"frames": 10}),
    )
    data = json.loads(path.read_text())
    assert list(data) == [
        *("schema_version", "command", "config", "inputs", "counts", "exit_code"),
        *("model", "seed", "timings", "notes", "verdict", "versions"),
    ]
    assert data["schema_version"] == 1
    assert data["inputs"] == [{"path": "clip.mp4", "sha256": "ab"}]
    assert data["counts"] == {"declared": None, "decoded": 10, "damaged": 1, "lost": 2, "skipped": 3, "written": 10}
    assert data["timings"]["tags"] == {"total_s": 0.5, "mean_ms": 50.0, "frames": 10}
    assert data["timings"]["pose"]["mean_ms"] == 0.0
    assert (data["exit_code"], data["seed"], data["model"]["sha256"], data["notes"]) == (3, 7, "cd", ["cut"])
    assert data["verdict"] == {"frames": 10}
    assert path.read_text() == json.dumps(data, indent=2) + "\n"


def test_versions_are_those_installed() -> None:
    versions = installed_versions()
    assert versions["landtool"] == landtool.__version__
    assert versions["numpy"] == np.__version__
    assert {"python", "opencv", "av", "apriltag"} <= {name for name, version in versions.items() if version}


def test_any_config_becomes_json(tmp_path: Path) -> None:
    config = {
        "camera": Camera(640, 480, 500.0, 500.0, 320.0, 240.0),
        "path": Path("a/b"),
        "rate": Fraction(30000, 1001),
        "limits": (math.inf, math.nan, 1.5),
        "array": np.array([[1.0, 2.0]]),
        "number": np.float32(0.5),
        "ids": {5, 3},
        "nested": {1: {"deep": True}},
    }
    data = json.loads(write_run(tmp_path, record(config=config)).read_text())["config"]
    assert data["camera"]["fx"] == 500.0
    assert data["limits"] == [None, None, 1.5]
    del data["camera"], data["limits"]
    assert data == {
        "path": "a/b",
        "rate": "30000/1001",
        "array": [[1.0, 2.0]],
        "number": 0.5,
        "ids": [3, 5],
        "nested": {"1": {"deep": True}},
    }


def test_same_record_same_bytes(tmp_path: Path) -> None:
    first = write_run(tmp_path / "a", record()).read_bytes()
    assert write_run(tmp_path / "b", record()).read_bytes() == first


def test_refuses_an_existing_record(tmp_path: Path) -> None:
    write_run(tmp_path, record())
    with pytest.raises(OutputExistsError):
        write_run(tmp_path, record())
    write_run(tmp_path, record(exit_code=0), overwrite=True)
    assert json.loads((tmp_path / "run.json").read_text())["exit_code"] == 0


class TestSha256:
    def test_of_a_file_is_the_usual_one(self, tmp_path: Path) -> None:
        content = bytes(range(256)) * 10_000
        (tmp_path / "a").write_bytes(content)
        assert sha256_of(tmp_path / "a") == hashlib.sha256(content).hexdigest()

    def test_of_a_folder_depends_on_names_and_contents_only(self, tmp_path: Path) -> None:
        def folder(name: str, files: dict[str, str]) -> Path:
            for file, text in files.items():
                (tmp_path / name / file).parent.mkdir(parents=True, exist_ok=True)
                (tmp_path / name / file).write_text(text)
            return tmp_path / name

        one = sha256_of(folder("one", {"a.png": "A", "sub/b.png": "B"}))
        assert sha256_of(folder("two", {"sub/b.png": "B", "a.png": "A"})) == one
        others = [{"a.png": "A", "sub/b.png": "C"}, {"a.png": "A", "sub/c.png": "B"}, {"a.png": "A"}]
        digests = {sha256_of(folder(f"other{i}", files)) for i, files in enumerate(others)}
        assert len(digests | {one}) == 4

    def test_what_cannot_be_read(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="cannot be read"):
            sha256_of(tmp_path / "missing")
