"""Every example of the docs runs, ends with the exit code it says, and prints what it shows."""

from __future__ import annotations

import re
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from landtool_cli.main import run
from tests.docs.conftest import PAGES
from tests.shared import ROOT

# As shown, and as run here
SMALLER = (
    (" -n 1120", " -n 4 --size 160x120"),
    (" -n 6000", " -n 8 --size 96x96 --split 0.5,0.5"),
    ("train --data data/data.yaml", "train --data data/data.yaml --iterations 2 --batch 2 --size 96x96 --bf16 off"),
    ("generate clip -o landing.mp4", "generate clip -o landing.mp4 --size 160x120 --fps 5"),
)
# Pages whose examples run elsewhere, with what they need
ELSEWHERE = {"extending.md": "test_extending.py", "ci.md": "test_ci.py"}
# A block begins with ```console, or ```console exit=3 where its last command ends so
BLOCK = re.compile(r"^```console(?: exit=(\d+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Example:
    """A command, the exit code it must have, and the lines shown below it; `...` stands for anything."""

    command: str
    code: int
    shown: tuple[str, ...]


def examples(page: Path) -> list[Example]:
    """Return a page's examples in order."""
    found = []
    for code, body in BLOCK.findall(page.read_text(encoding="utf-8")):
        commands = re.split(r"^\$ ", body, flags=re.MULTILINE)
        assert commands[0] == "", f"{page.name}: a console block does not begin with a command"
        for number, text in enumerate(commands[1:]):
            command, *shown = text.splitlines()
            last = number == len(commands) - 2
            found.append(Example(command, int(code or 0) if last else 0, tuple(shown)))
    return found


def pattern(shown: tuple[str, ...]) -> str:
    """Return the regular expression of shown lines."""
    lines = []
    for line in shown:
        any_line = r"(?:.*\n)*?"
        lines.append(any_line if line == "..." else ".*".join(map(re.escape, line.split("..."))) + r"\n")
    return "".join(lines)


def smaller(command: str) -> list[str]:
    """Return a command's arguments; what would take a minute is made smaller."""
    for shown, run_as in SMALLER:
        command = command.replace(shown, run_as)
    return shlex.split(command)[1:]


@pytest.fixture
def reader_folder(recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of its own for one page's reader, with all files, as the current folder."""
    folder = tmp_path / "reader"
    shutil.copytree(recordings, folder)
    monkeypatch.chdir(folder)
    return folder


@pytest.mark.parametrize("page", [p for p in PAGES if p.name not in ELSEWHERE and examples(p)], ids=lambda p: p.name)
@pytest.mark.usefixtures("reader_folder")
def test_examples_run(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if page.name == "train.md":
        pytest.importorskip("torch", reason="torch is not installed: pip install 'landtool[train]'")
    for example in examples(page):
        program = shlex.split(example.command)[0]
        if program == "make":  # needs the repository and a network
            continue
        assert program == "landtool", f"only landtool and make are run: {example.command}"
        code = run(smaller(example.command))
        out, err = capsys.readouterr()
        assert code == example.code, f"{example.command}\n{out}{err}"
        if example.shown:
            assert re.fullmatch(pattern(example.shown), out + err), f"{example.command}\n{out}{err}"


def test_make_lines_name_targets() -> None:
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    texts = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    named = set(re.findall(r"`make ([a-z-]+)`", texts)) | set(re.findall(r"^\$ make (\S+)", texts, re.MULTILINE))
    assert named
    assert named <= set(targets)


def test_what_is_made_smaller_is_shown() -> None:
    commands = [example.command for page in PAGES for example in examples(page)]
    assert all(any(shown in command for command in commands) for shown, _ in SMALLER)


def test_shown_lines_are_compared() -> None:
    assert re.fullmatch(pattern(("a ... c", "...", "z")), "a b c\nx\ny\nz\n")
    assert not re.fullmatch(pattern(("a ... c", "...", "z")), "a b d\nx\nz\n")
    assert not re.fullmatch(pattern(("z",)), "a\nz\n")
