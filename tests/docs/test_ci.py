"""The gate of docs/ci.md, in a scratch repository: its workflow passes, and fails when a setting is made worse."""

from __future__ import annotations

import csv
import os
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
import yaml

from landtool.io.source import open_source
from landtool.io.video_out import VideoWriter
from landtool.types import Frame
from tests.docs.conftest import DOCS, FIXTURES, named_blocks
from tests.docs.test_examples import examples

PAGE = DOCS / "ci.md"
WORKFLOW = ".github/workflows/landing.yml"
FILES = {WORKFLOW, "landtool.toml", "tolerance.toml", ".gitignore"}
CLIP, FRAMES = "straight", 30
# As the page has it, and so short that a test can wait for it
SHORTER = ("--duration 4 --height 5", "--duration 2 --fps 8 --height 2")


@dataclass(frozen=True)
class Repository:
    """A scratch repository, and the environment its workflow runs in."""

    folder: Path
    environment: dict[str, str]

    def sh(self, script: str) -> subprocess.CompletedProcess[str]:
        """Run a script as a GitHub runner does."""
        command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script]
        return subprocess.run(
            command, cwd=self.folder, env=self.environment, capture_output=True, text=True, check=False
        )

    def workflow(self) -> dict[str, subprocess.CompletedProcess[str]]:
        """Run the steps of the workflow that is there, by their names; after a failure those that say so."""
        steps: list[dict[str, Any]] = yaml.safe_load((self.folder / WORKFLOW).read_text("utf-8"))["jobs"]["gate"][
            "steps"
        ]
        done: dict[str, subprocess.CompletedProcess[str]] = {}
        for step in steps:
            failed = any(result.returncode for result in done.values())
            if "run" in step and (not failed or step.get("if") == "${{ !cancelled() }}"):
                done[step["name"]] = self.sh(step["run"])
        return done


@pytest.fixture(scope="module")
def repository(tmp_path_factory: pytest.TempPathFactory) -> Repository:
    """What the page says, committed and checked out anew, with the first second of a fixture as its own clip."""
    top = tmp_path_factory.mktemp("gate")
    made = top / "made"
    for name, text in named_blocks(PAGE):
        (made / name).parent.mkdir(parents=True, exist_ok=True)
        (made / name).write_text(text, encoding="utf-8")
    cut_clip(made / "clips", CLIP, FRAMES)
    author = {f"GIT_{who}_{what}": "test@localhost" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}
    environment = {**os.environ, **author, "PATH": f"{programs(top / 'bin')}{os.pathsep}{os.environ['PATH']}"}
    here = Repository(made, environment)
    for example in examples(PAGE)[:2]:  # a generated clip, the first baseline
        told = here.sh(example.command.replace(*SHORTER))
        assert told.returncode == 0, told.stderr
    told = here.sh("git init -q && git add -A && git commit -q -m first && git clone -q . ../checked-out")
    assert told.returncode == 0, told.stderr
    return Repository(top / "checked-out", environment)


def programs(folder: Path) -> Path:
    """Write `landtool` as a program, and a `pip` that only writes down what it was asked for: tests have no network."""
    folder.mkdir()
    call = f"exec {shlex.quote(sys.executable)} -c 'from landtool_cli.main import main; main()'"
    for name, line in {"landtool": f'{call} "$@"', "pip": 'echo "$@" >> pip.txt'}.items():
        (folder / name).write_text(f"#!/bin/sh\n{line}\n", encoding="utf-8")
        (folder / name).chmod(0o755)
    return folder


def cut_clip(folder: Path, name: str, count: int) -> None:
    """Copy a fixture's first frames, and of the files beside it what is about them."""
    folder.mkdir(parents=True)
    for ending in ("camera.yaml", "pad.toml", "ego.csv"):
        shutil.copy(FIXTURES / f"{name}.{ending}", folder)
    with open_source(FIXTURES / f"{name}.mp4") as source:
        info = source.info
        with VideoWriter(folder / f"{name}.mp4", info.width, info.height, info.time_base or Fraction(1, 1000)) as video:
            for frame, _ in zip(source, range(count), strict=False):
                assert isinstance(frame, Frame)
                assert frame.t_ns is not None
                video.write(frame.image, frame.t_ns)
    with (FIXTURES / f"{name}.truth.csv").open(encoding="utf-8", newline="") as truth:
        rows = [row for _, row in zip(range(count + 1), csv.reader(truth), strict=False)]
    lines = "".join(",".join(row) + "\n" for row in rows)
    (folder / f"{name}.truth.csv").write_text(lines, encoding="utf-8")


def test_the_page_holds_every_file_it_lists() -> None:
    assert {name for name, _ in named_blocks(PAGE)} == FILES
    assert "--overwrite" not in PAGE.read_text(encoding="utf-8")
    text = PAGE.read_text(encoding="utf-8")
    assert all(name in text.split("## The clips")[0] for name in FILES)


def test_what_landtool_writes_is_not_kept(repository: Repository) -> None:
    told = repository.sh("git ls-files")
    kept = {name.partition("/")[0] for name in told.stdout.splitlines()}
    assert kept == {"clips", "landtool.toml", "baseline.json", "tolerance.toml", ".github", ".gitignore"}
    told = repository.sh("cd ../made && git status --porcelain --ignored")
    assert told.stdout == "!! score/\n"


def test_the_gate_passes_and_fails(repository: Repository) -> None:
    done = repository.workflow()
    assert {name: result.returncode for name, result in done.items()} == dict.fromkeys(done, 0), done
    assert list(done) == ["Install landtool", "Evaluate", "Report"]
    kept = yaml.safe_load((repository.folder / WORKFLOW).read_text("utf-8"))["jobs"]["gate"]["steps"][-1]
    assert all((repository.folder / name).is_file() for name in kept["with"]["path"].split())
    assert (repository.folder / "pip.txt").read_text(encoding="utf-8") == "install landtool\n"

    settings = repository.folder / "landtool.toml"
    text = settings.read_text(encoding="utf-8")
    assert text.count("conf = 0.25") == 1
    settings.write_text(text.replace("conf = 0.25", "conf = 0.99"), encoding="utf-8")
    repository.sh("git clean -fdxq")
    done = repository.workflow()
    assert {name: result.returncode for name, result in done.items()} == {
        "Install landtool": 0,
        "Evaluate": 1,
        "Report": 0,
    }, done
    assert "detection.recall" in done["Evaluate"].stdout
    assert "<failure" in (repository.folder / "junit.xml").read_text(encoding="utf-8")
    assert (repository.folder / "report.html").is_file()


@pytest.mark.full
def test_a_baseline_is_written_anew(repository: Repository) -> None:
    repository.sh("git checkout -q . && git clean -fdxq")
    before = (repository.folder / "baseline.json").read_bytes()
    last = examples(PAGE)[-1].command
    assert "--update-baseline" in last
    told = repository.sh(f"sed -i 's/conf = 0.25/conf = 0.6/' landtool.toml && {last}")
    assert told.returncode == 0, told.stderr
    assert (repository.folder / "baseline.json").read_bytes() != before
    repository.sh("git clean -fdxq")
    assert repository.workflow()["Evaluate"].returncode == 0
