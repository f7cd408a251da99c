"""What a wheel of the project holds, built from a copy of the sources and without a network."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# setuptools, run by itself: the build back end as pip calls it, without fetching an environment for it
BUILD = "import sys; from setuptools import build_meta; print(build_meta.build_wheel(sys.argv[1]))"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The names of the files in the wheel."""
    copy = tmp_path_factory.mktemp("sources")
    skip = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for folder in ("landtool", "cli"):
        shutil.copytree(ROOT / folder, copy / folder, ignore=skip)
    for file in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / file, copy / file)
    # what lies beside the packages must not get into the wheel
    (copy / "tests" / "landtool_fake").mkdir(parents=True)
    (copy / "tests" / "landtool_fake" / "__init__.py").touch()
    done = subprocess.run([sys.executable, "-c", BUILD, "."], cwd=copy, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return zipfile.ZipFile(copy / done.stdout.splitlines()[-1]).namelist()


def test_the_wheel_has_two_packages_and_nothing_else(wheel: list[str]) -> None:
    top = {name.split("/")[0] for name in wheel}
    assert {name for name in top if not name.endswith(".dist-info")} == {"landtool", "landtool_cli"}


def test_every_module_is_in_the_wheel(wheel: list[str]) -> None:
    modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "landtool").rglob("*.py")}
    modules |= {path.relative_to(ROOT / "cli").as_posix() for path in (ROOT / "cli").rglob("*.py")}
    assert modules == {name for name in wheel if name.endswith(".py")}


@pytest.mark.parametrize("folder", ["data", "models"])
def test_data_is_in_the_wheel(folder: str, wheel: list[str]) -> None:
    files = {path.relative_to(ROOT).as_posix() for path in (ROOT / "landtool" / folder).glob("*") if path.is_file()}
    assert files <= set(wheel)


def test_what_the_library_reads_at_run_time_is_in_the_wheel(wheel: list[str]) -> None:
    assert {"landtool/data/tag_families.npz", "landtool/py.typed"} <= set(wheel)
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in wheel)


def test_one_opencv_and_no_copyleft_in_the_dependencies() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    names = [name for group in project["optional-dependencies"].values() for name in group] + project["dependencies"]
    # two distributions of OpenCV overwrite each other's files
    assert [name for name in names if "opencv" in name] == ["opencv-contrib-python-headless>=5.0"]
    gpl = ("ultralytics", "evo", "mcap-ros2-support-fast", "mcap-codec-support")
    assert not [name for name in names if name.split(">")[0] in gpl]
