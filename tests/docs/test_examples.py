"""Every example of the docs runs, ends with the exit code it says, and prints what it shows."""

from __future__ import annotations

import importlib.util
import re
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path

import click
import pytest

from bench.__main__ import PARTS
from landtool_cli.main import cli, run
from tests.docs.conftest import FENCE, PAGES, blocks
from tests.shared import ROOT

# All texts that may show a command
TEXTS = [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "datasets" / "README.md", ROOT / "landtool" / "models" / "README.md"]
# As shown, and as run here
SMALLER = (
    (" -n 1120", " -n 8 --size 96x96 --split 0.5,0.5"),
    (" -n 6000", " -n 8 --size 96x96 --split 0.5,0.5"),
    ("train --data data/data.yaml", "train --data data/data.yaml --iterations 2 --batch 2 --size 96x96 --bf16 off"),
    ("generate clip -o landing.mp4", "generate clip -o landing.mp4 --size 160x120 --fps 5"),
    ("generate clip -o clips/landing.mp4", "generate clip -o clips/landing.mp4 --size 240x180 --fps 8 --height 3"),
)
# Pages whose examples run elsewhere, with what they need
ELSEWHERE = {"extending.md": "test_extending.py", "ci.md": "test_ci.py"}
# Pages that begin in an empty folder, and what of the files comes from elsewhere in the end
EMPTY = {"start.md": ("flight.mp4",)}
# What is shown and not run here, by how it begins, and why; everything else that is a command runs
NOT_RUN = {
    "make": "needs the repository and a network; the target must exist",
    "python3 -m venv": "the tests run in an environment of their own",
    ". ~/landtool-env": "the tests run in an environment of their own",
    "pip install": "needs a network",
    "landtool completion": "shown with the reader's shell and files; tests/cli prints the scripts",
}
# Begins a command in a block that is not ```console
COMMAND = re.compile(r"^(?:\$ |landtool [a-z]|make [a-z]|pip |python3? |\.venv/|bash |sudo |apt)")


@dataclass(frozen=True)
class Example:
    """A command, the exit code it must have, and the lines shown below it; `...` stands for anything.

    needs: a package without which it cannot run, else empty.
    """

    command: str
    code: int
    shown: tuple[str, ...]
    needs: str = ""


def examples(page: Path) -> list[Example]:
    """Return a page's examples in order.

    A block begins with ```console, with `exit=3` behind it where its last command ends so, and with `needs=torch`.
    """
    found = []
    for block in blocks(page, "console"):
        says = dict(word.split("=") for word in block.says.split())
        commands = re.split(r"^\$ ", block.text, flags=re.MULTILINE)
        assert commands[0] == "", f"{page.name}: a console block does not begin with a command"
        for number, text in enumerate(commands[1:]):
            command, *shown = text.splitlines()
            code = int(says.get("exit", 0)) if number == len(commands) - 2 else 0
            found.append(Example(command, code, tuple(shown), says.get("needs", "")))
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
def reader_folder(page: Path, recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder of its own for one page's reader, with all files, the current folder."""
    folder = tmp_path / "reader"
    if page.name in EMPTY:
        folder.mkdir()
        for name in EMPTY[page.name]:
            shutil.copy(recordings / name, folder)
    else:
        shutil.copytree(recordings, folder)
    monkeypatch.chdir(folder)


@pytest.mark.parametrize("page", [p for p in PAGES if p.name not in ELSEWHERE and examples(p)], ids=lambda p: p.name)
@pytest.mark.usefixtures("reader_folder")
def test_examples_run(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = ""
    for example in examples(page):
        if example.command.startswith(tuple(NOT_RUN)):
            continue
        if example.needs and importlib.util.find_spec(example.needs) is None:
            missing = example.needs
            continue
        program = shlex.split(example.command)[0]
        assert program == "landtool", f"neither run nor in NOT_RUN: {example.command}"
        code = run(smaller(example.command))
        out, err = capsys.readouterr()
        assert code == example.code, f"{example.command}\n{out}{err}"
        if example.shown:
            assert re.fullmatch(pattern(example.shown), out + err), f"{example.command}\n{out}{err}"
    if missing:
        pytest.skip(f"all but the commands that need {missing}, which is not installed, ran")


@pytest.mark.parametrize("page", TEXTS, ids=lambda p: f"{p.parent.name}/{p.name}")
def test_a_block_with_a_command_is_an_example(page: Path) -> None:
    for block in blocks(page):
        if block.kind in ("console", "yaml", "python", "diff"):  # the last three are run by the tests of their pages
            continue
        lines = [line for line in block.text.splitlines() if COMMAND.match(line)]
        shown = [line for line in lines if not line.removeprefix("$ ").startswith(tuple(NOT_RUN))]
        assert not shown, f"{page.name}: make it ```console, or say in NOT_RUN why it does not run"


def test_nothing_is_left_out_without_need() -> None:
    lines = [line for page in TEXTS for block in blocks(page) for line in block.text.splitlines()]
    assert all(any(line.removeprefix("$ ").startswith(begin) for line in lines) for begin in NOT_RUN)


@pytest.mark.parametrize("page", TEXTS, ids=lambda p: f"{p.parent.name}/{p.name}")
def test_commands_in_the_text_have_their_options(page: Path) -> None:
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    context = click.Context(cli)
    for said in re.findall(r"`landtool ([^`]+)`", text):
        words = " ".join(said.split()).split(" ")
        command = cli.get_command(context, words[0])
        assert command is not None or words[0].startswith("-"), f"{page.name}: landtool {said}"
        if isinstance(command, click.Group):
            command = command.commands.get(words[1], command) if len(words) > 1 else command
        known = {name for item in getattr(command, "params", ()) for name in (*item.opts, *item.secondary_opts)}
        options = {word.rstrip(",") for word in words if word.startswith("--")}
        assert options <= {*known, "--help", "--version"}, f"{page.name}: landtool {said}"


def test_benchmarks_named_exist() -> None:
    named = [name for page in TEXTS for name in re.findall(r"python -m bench(\.?[\w ]*)", page.read_text("utf-8"))]
    assert len(named) > 5
    for name in named:
        if name.startswith("."):
            assert (ROOT / "bench" / f"{name[1:].split()[0]}.py").exists(), name
        else:
            assert set(name.split()) <= set(PARTS), name


def test_make_lines_name_targets() -> None:
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    texts = "\n".join(page.read_text(encoding="utf-8") for page in TEXTS)
    named = set(re.findall(r"`make ([a-z-]+)`", texts)) | set(
        re.findall(r"^(?:\$| {3}) make (\S+)", texts, re.MULTILINE)
    )
    assert named
    assert named <= set(targets)


def test_what_is_made_smaller_is_shown() -> None:
    commands = [example.command for page in PAGES for example in examples(page)]
    assert all(any(shown in command for command in commands) for shown, _ in SMALLER)


def test_shown_lines_are_compared() -> None:
    assert re.fullmatch(pattern(("a ... c", "...", "z")), "a b c\nx\ny\nz\n")
    assert not re.fullmatch(pattern(("a ... c", "...", "z")), "a b d\nx\nz\n")
    assert not re.fullmatch(pattern(("z",)), "a\nz\n")
