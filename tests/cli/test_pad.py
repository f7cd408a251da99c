"""`landtool pad` from the outside: files, what it says, what it refuses."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from landtool.pad import PadSpec, PadTag
from landtool_cli.main import run

Said = pytest.CaptureFixture[str]

STARTS = {".pdf": b"%PDF-", ".svg": b"<?xml", ".png": b"\x89PNG"}


@pytest.mark.parametrize("suffix", list(STARTS))
def test_makes_each_format_and_says_which_size(suffix: str, tmp_path: Path, capsys: Said) -> None:
    output = tmp_path / f"pad{suffix}"
    assert run(["pad", "-o", str(output), "--dpi", "72"]) == 0
    assert output.read_bytes().startswith(STARTS[suffix])
    out, err = capsys.readouterr()
    assert err == ""
    assert out.startswith(f"{output}: pad v1, D = 0.18 m, one sheet of 210 x 297 mm\n")
    assert "tag36h11 id 5: 28.8 mm" in out
    assert [path.name for path in tmp_path.iterdir()] == [output.name]


def test_the_advice_makes_the_pad_file_that_fits_the_print(
    tmp_path: Path, capsys: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["pad", "-o", "pad.svg", "--diameter", "0.123456789"]) == 0
    advice = re.search(r"landtool (pad .*)$", capsys.readouterr().out)
    assert advice
    assert run(shlex.split(advice[1])) == 0
    assert PadSpec.read(Path("pad.toml")) == PadSpec(diameter_m=0.123456789)


def test_a_pad_file_gives_the_target_and_its_size(tmp_path: Path, capsys: Said) -> None:
    pad = PadSpec(name="mine", diameter_m=0.15, tags=(PadTag(id=7),))
    file = tmp_path / "mine.toml"
    file.write_text(pad.to_toml())
    assert run(["pad", "-o", str(tmp_path / "a.svg"), "--pad", str(file)]) == 0
    out = capsys.readouterr().out
    assert "mine, D = 0.15 m" in out
    assert f"--pad {file}" in out
    assert run(["pad", "-o", str(tmp_path / "b.toml"), "--pad", str(file), "--diameter", "0.1"]) == 0
    assert PadSpec.read(tmp_path / "b.toml") == pad.scaled(0.1)


def test_a_large_target_is_said_to_be_tiled(tmp_path: Path, capsys: Said) -> None:
    assert run(["pad", "-o", str(tmp_path / "a.pdf"), "--diameter", "0.5", "--page", "a3"]) == 0
    assert "6 pages of 297 x 420 mm, 2 rows of 3" in capsys.readouterr().out
    assert run(["pad", "-o", str(tmp_path / "a.svg"), "--diameter", "0.5", "--page", "a3"]) == 0
    assert "one sheet of 570 x 600 mm" in capsys.readouterr().out


def test_an_output_that_exists_is_kept(tmp_path: Path, capsys: Said) -> None:
    output = tmp_path / "pad.svg"
    output.write_text("mine")
    assert run(["pad", "-o", str(output)]) == 2
    assert (
        capsys.readouterr().err == f"landtool: error: {output}: exists already; choose another -o or pass --overwrite\n"
    )
    assert output.read_text() == "mine"
    assert run(["pad", "-o", str(output), "--overwrite"]) == 0
    assert output.read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("args", "code", "said"),
    [
        (["-o", "pad.jpg"], 2, "pad.jpg: unknown kind of output; use one of .pdf, .svg, .png, .toml"),
        (["-o", "pad"], 2, "pad: unknown kind of output"),
        ([], 2, "missing option '-o' / '--output'"),
        (["-o", "a.svg", "--diameter", "0"], 2, "invalid value for '--diameter'"),
        (["-o", "a.svg", "--diameter", "nan"], 2, "invalid value for '--diameter'"),
        (["-o", "a.svg", "--page", "a5"], 2, "invalid value for '--page': 'a5' is not one of 'a4', 'a3', 'letter'"),
        (["-o", "a.pdf", "--diameter", "90"], 2, "a target 99 m wide needs"),
        (["-o", "a.png", "--diameter", "90"], 2, "1169525 x 1169880 pixels are too many; write an .svg"),
        (["-o", "a.svg", "--pad", "none.toml"], 2, "none.toml: does not exist; "),
        (["-o", "a.svg", "--pad", "bad.toml"], 1, "bad.toml: unknown key 'diametre_m'; nearest known key is"),
        (["-o", "bad.toml", "--pad", "bad.toml", "--overwrite"], 2, "bad.toml: is the input itself"),
    ],
)
def test_what_it_refuses(
    args: list[str], code: int, said: str, tmp_path: Path, capsys: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.toml").write_text("diametre_m = 1.0\n")
    assert run(["pad", *args]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"landtool: error: {said}")
    assert err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["bad.toml"]
    assert Path("bad.toml").read_text() == "diametre_m = 1.0\n"
