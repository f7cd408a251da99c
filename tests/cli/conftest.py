"""A landing to track, in a folder of its own."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from landtool_cli.main import run
from tests.cli.landing import Landing, record


@dataclass(frozen=True)
class Told:
    """What a call of the program ended with."""

    code: int
    out: str
    err: str

    @property
    def lines(self) -> list[str]:
        return self.err.splitlines()


Track = Callable[..., Told]


@pytest.fixture(scope="session")
def landing(tmp_path_factory: pytest.TempPathFactory) -> Landing:
    """The landing, rendered once; nothing writes into its folder."""
    return record(tmp_path_factory.mktemp("landing"))


@pytest.fixture
def here(landing: Landing, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with clip.mp4 and camera.yaml in it."""
    monkeypatch.chdir(tmp_path)
    for path in landing.folder.iterdir():
        shutil.copy(path, tmp_path)
    return tmp_path


@pytest.fixture
def track(here: Path, capfd: pytest.CaptureFixture[str]) -> Track:  # noqa: ARG001 - called in `here`
    """Return a function that calls `landtool track`; what native libraries print is caught too."""

    def call(*args: str) -> Told:
        capfd.readouterr()
        code = run(["track", *args])
        return Told(code, *capfd.readouterr())

    return call
