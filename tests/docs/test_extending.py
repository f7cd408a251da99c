"""What docs/extending.md adds is added to a copy of landtool as the page says, and keeps the contracts."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest

from tests.docs.conftest import DOCS, blocks
from tests.docs.test_examples import examples
from tests.shared import ROOT

PAGE = DOCS / "extending.md"
COPIED = ("landtool", "cli", "tests", "pyproject.toml")
LANDTOOL = "from landtool_cli.main import main; main()"
CONTRACTS = ("jsonl", "timed-images", "edges")


def texts(kind: str) -> list[str]:
    return [block.text for block in blocks(PAGE, kind)]


def new_files() -> dict[str, str]:
    found = [re.fullmatch(r"# (\S+\.py)\n(.*)", block, re.DOTALL) for block in texts("python")]
    assert all(found)
    return {match[1]: match[2] for match in found if match}


def changes() -> Iterator[tuple[str, str, str]]:
    """Yield each change: the file, the lines as they are, and as they become."""
    for block in texts("diff"):
        for name, body in re.findall(r"^--- (\S+)\n(.*?)(?=^--- |\Z)", block, re.MULTILINE | re.DOTALL):
            for part in body.split("@@\n"):
                lines = part.splitlines(keepends=True)
                assert all(line[0] in " +-" for line in lines), part
                old, new = ("".join(line[1:] for line in lines if line[0] != left) for left in "+-")
                yield name, old, new


def program(copy: Path, *arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": f"{copy}{os.pathsep}{copy / 'cli'}", "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, *arguments], cwd=cwd or copy, env=environment, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("landtool")
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, folder)
    for name, text in new_files().items():
        assert not (folder / name).exists()
        (folder / name).write_text(text, encoding="utf-8")
    for name, old, new in changes():
        text = (folder / name).read_text(encoding="utf-8")
        assert text.count(old) == 1, f"{name} has {text.count(old)} places like\n{old}"
        (folder / name).write_text(text.replace(old, new), encoding="utf-8")
    return folder


def test_every_change_changes_something() -> None:
    assert all(old != new for _, old, new in changes())


def test_the_additions_keep_the_contracts(copy: Path) -> None:
    done = program(
        copy, "-m", "pytest", "tests/contracts", "-p", "no:cacheprovider", "-k", " or ".join(CONTRACTS), "-vv"
    )
    assert done.returncode == 0, done.stdout
    assert all(f"[{name}]" in done.stdout for name in CONTRACTS)


def test_the_tables_of_the_contracts_are_complete(copy: Path) -> None:
    tests = "every_layout_has_a_case or table_of_sinks_has_them_all"
    done = program(copy, "-m", "pytest", "tests/contracts", "-p", "no:cacheprovider", "-k", tests)
    assert done.returncode == 0, done.stdout
    assert "2 passed" in done.stdout


def test_the_additions_are_written_as_the_rest_is(copy: Path) -> None:
    touched = sorted({*new_files(), *(name for name, _, _ in changes() if name.endswith(".py"))})
    for check in (["format", "--check"], ["check"]):
        done = program(copy, "-m", "ruff", *check, *touched)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.full
def test_the_additions_have_types_and_layers(copy: Path) -> None:
    for command in (
        ["-m", "mypy"],
        ["-c", "from importlinter.cli import lint_imports_command; lint_imports_command()"],
    ):
        done = program(copy, *command)
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_commands_run(copy: Path, recordings: Path, tmp_path: Path) -> None:
    shutil.copy(recordings / "left.mp4", tmp_path)
    shutil.copytree(recordings / "photos", tmp_path / "photos")
    timed_folder(tmp_path / "photos", tmp_path / "cam0")
    outputs = {}
    for example in examples(PAGE):
        done = program(copy, "-c", LANDTOOL, *shlex.split(example.command)[1:], cwd=tmp_path)
        assert done.returncode == example.code, f"{example.command}\n{done.stderr}"
        outputs[example.command.split()[1]] = done.stdout
    assert len((tmp_path / "mine" / "left" / "places.jsonl").read_text(encoding="utf-8").splitlines()) == 6
    frames = (tmp_path / "mine" / "cam0" / "frames.csv").read_text(encoding="utf-8").splitlines()
    assert [line.split(",")[1] for line in frames[1:]] == [str(t_ns) for t_ns in TIMES_NS]
    assert re.search(r"^ +\d+  \w", outputs["reasons"], re.MULTILINE)


TIMES_NS = [1_400_000_000_000_000_000 + 50_000_000 * index for index in range(6)]


def timed_folder(photos: Path, folder: Path) -> None:
    shutil.copytree(photos, folder / "data")
    names = [f"img{index + 1}.png" for index in range(len(TIMES_NS))]
    assert all(cv2.haveImageReader(str(folder / "data" / name)) for name in names)
    lines = [f"{t_ns},{name}" for t_ns, name in zip(TIMES_NS, names, strict=True)]
    (folder / "data.csv").write_text("\n".join(lines), encoding="utf-8")
