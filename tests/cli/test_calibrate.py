"""`landtool calibrate`, `pad --board` and `generate board` from the outside."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import cv2
import numpy as np
import pypdfium2
import pytest

from landtool.calibrate.board import KINDS, Board
from landtool.calibrate.corners import find_board
from landtool.geometry import Pose
from landtool.io.calibration import read_camera
from landtool.pad import PadSpec
from landtool.synth.board_clip import BoardClipConfig, film_board
from landtool.synth.board_view import Scene, draw_board
from landtool.synth.sensor import Sensor
from landtool_cli.main import run
from tests.shared import ROOT, shared_data

Said = pytest.CaptureFixture[str]
FIXTURES = ROOT / "datasets" / "fixtures"


@pytest.fixture(scope="session")
def stills(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of 16 pictures of the usual ChArUco board."""
    folder = tmp_path_factory.mktemp("boards")
    config = BoardClipConfig(duration_s=7.2, fps=BoardClipConfig().fps * 2 / 9, seed=3)
    for index, (image, _) in enumerate(film_board(config)):
        cv2.imwrite(str(folder / f"{index:02}.png"), image)
    return folder


@pytest.fixture
def here(stills: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(stills, tmp_path / "boards")
    return tmp_path


def test_the_fixture_gives_its_camera(tmp_path: Path, capsys: Said) -> None:
    output = tmp_path / "camera.yaml"
    assert run(["calibrate", str(FIXTURES / "board.mp4"), "-o", str(output)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "verdict: good" in out
    assert len(out.splitlines()) <= 12
    camera, truth = read_camera(output), read_camera(FIXTURES / "board.camera.yaml")
    assert abs(camera.fx / truth.fx - 1) < 0.002
    assert abs(camera.fy / truth.fy - 1) < 0.002
    assert abs(camera.cx - truth.cx) < 1.0
    assert abs(camera.cy - truth.cy) < 1.0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["camera.json", "camera.report.png", "camera.yaml"]
    values = json.loads((tmp_path / "camera.json").read_text())
    assert values["parameters"]["fx"]["value"] == camera.fx
    assert values["frames"] == 60
    report = cv2.imread(str(tmp_path / "camera.report.png"))
    assert report is not None
    assert report.shape[1] == 1400


def test_a_folder_of_images_and_what_is_left_out(here: Path, capsys: Said) -> None:
    (here / "boards" / "05.png").write_bytes(b"\x89PNG\r\n\x1a\nbroken")
    cv2.imwrite(str(here / "boards" / "06.png"), np.zeros((50, 60, 3), np.uint8))
    assert run(["calibrate", "boards", "-o", "camera.yaml"]) == 3
    out, err = capsys.readouterr()
    assert "boards: 1 picture is not 640x480 as the first one and left out: 06.png" in err
    assert "boards: 1 picture lost or damaged and left out: 05.png; " in err
    assert "board found in 14 of 14 pictures" in out
    assert read_camera(here / "camera.yaml").width == 640
    left_out = json.loads((here / "camera.json").read_text())["left_out"]
    assert [(item["frame"], item["file"]) for item in left_out] == [(5, "05.png"), (6, "06.png")]
    assert all(item["reason"] for item in left_out)


def test_pictures_cut_in_half_are_named(here: Path, capsys: Said) -> None:
    for index in (3, 7, 8, 11):
        path = here / "boards" / f"{index:02}.png"
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert run(["calibrate", "boards", "-o", "camera.yaml"]) == 3
    assert (
        "boards: 4 pictures lost or damaged and left out: 03.png, 07.png, 08.png, 1 more; " in capsys.readouterr().err
    )


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", ["camera.json", "camera.txt", "camera", "camera.report.png"])
def test_another_ending_than_yaml_is_refused(name: str, here: Path, capsys: Said) -> None:
    assert run(["calibrate", "boards", "-o", name]) == 2
    assert f"{name}: is no name of a camera's YAML; end its name in .yaml or .yml" in capsys.readouterr().err
    assert [path.name for path in here.iterdir()] == ["boards"]


def film(folder: Path, board: Board, poses: list[Pose]) -> None:
    folder.mkdir()
    config, rng = BoardClipConfig(board), np.random.default_rng(0)
    for index, pose in enumerate(poses):
        image = draw_board(
            Scene(board), config.camera, pose, Sensor(psf_sigma_px=0.6, shot_variance=1e-4, read_variance=5e-6), rng
        )
        cv2.imwrite(str(folder / f"{index:02}.png"), image)


def test_a_board_never_tilted_gives_no_camera(tmp_path: Path, capsys: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    film(
        tmp_path / "flat", Board(), [Pose(np.eye(3), np.array([*rng.uniform(-0.1, -0.06, 2), 0.32])) for _ in range(8)]
    )
    assert run(["calibrate", "flat", "-o", "camera.yaml"]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert re.search(r"flat: the views do not determine the camera.*; film the board.* tilted", err)
    assert [path.name for path in tmp_path.iterdir()] == ["flat"]


def test_a_poor_camera_says_so_and_is_read(tmp_path: Path, capsys: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rng, poses = np.random.default_rng(1), []
    for index in range(8):
        turn = Pose.from_rotvec(np.zeros(3), 0.03 * np.array([np.cos(2.4 * index), np.sin(2.4 * index), 0.0]))
        poses.append(Pose(turn.rotation, np.array([*rng.uniform(-0.1, -0.06, 2), 0.32])))
    film(tmp_path / "flat", Board(), poses)
    assert run(["calibrate", "flat", "-o", "camera.yml"]) == 3
    out = capsys.readouterr().out
    assert "verdict: poor" in out
    assert re.search(r"tilt up to \d+\.\d \+- \d\.\d degrees", out)
    text = (tmp_path / "camera.yml").read_text()
    assert text.startswith("# landtool calibrate: poor, rms 0.")
    assert "\n# only 8 views" in text
    assert read_camera(tmp_path / "camera.yml").width == 640


def test_a_recording_without_a_board_gets_no_hint_of_one(tmp_path: Path, capsys: Said) -> None:
    noise = tmp_path / "noise"
    noise.mkdir()
    for index in range(4):
        small = np.random.default_rng(index).integers(0, 256, (160, 213), np.uint8)
        picture = cv2.GaussianBlur(cv2.resize(small, (640, 480)), (0, 0), 1.5)
        cv2.imwrite(str(noise / f"{index}.png"), picture)
    for path in (noise, FIXTURES / "stop-and-go.mp4"):
        for args in ([], ["--board", "chessboard"], ["--board", "chessboard", "--squares", "4x4"]):
            assert run(["calibrate", str(path), "-o", str(tmp_path / "c.yaml"), *args]) == 1
            assert "nor is another board seen" in capsys.readouterr().err


def test_white_first_where_the_board_is_not(tmp_path: Path, capsys: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    board = Board("charuco", 6, 8, 0.02, 0.015)
    film(tmp_path / "even", board, [Pose(np.eye(3), np.array([-0.06 + 0.01 * i, -0.08, 0.3])) for i in range(4)])
    args = ["calibrate", "even", "-o", "c.yaml", "--squares", "6x8"]
    assert run([*args, "--white-first"]) == 1
    assert "whose first square is black; leave out --white-first" in capsys.readouterr().err
    assert run(["calibrate", "even", "-o", "c.yaml", "--white-first"]) == 2
    assert "a board of 8x11 whose first square is white; older OpenCV" in capsys.readouterr().err


@pytest.mark.full
def test_markers_in_the_film_of_a_chessboard(tmp_path: Path, capsys: Said) -> None:
    clip = str(FIXTURES / "board.mp4")
    assert run(["calibrate", clip, "--board", "chessboard", "-o", str(tmp_path / "c.yaml")]) in (0, 3)
    out, err = capsys.readouterr()
    assert re.search(r"board found in \d of \d\d pictures", out)
    assert "ArUco markers of 5x5 bits are seen; is it --board charuco?" in err
    assert "verdict: good" not in out


def test_another_lens_model_that_fits_better_is_said(tmp_path: Path, capsys: Said) -> None:
    clip = str(FIXTURES / "board.mp4")
    assert run(["calibrate", clip, "--model", "fisheye", "-o", str(tmp_path / "c.yaml")]) == 0
    out, err = capsys.readouterr()
    assert re.search(r"another lens model fits better, rms 0\.\d+ against 0\.\d+ px: --model plumb_bob", err)
    assert "verdict: usable" in out


def test_an_output_that_exists_is_kept(here: Path, capsys: Said) -> None:
    for name in ("camera.yaml", "camera.report.png", "camera.json"):
        path = here / name
        path.write_text("mine")
        assert run(["calibrate", "boards", "-o", "camera.yaml"]) == 2
        assert "exists already" in capsys.readouterr().err
        assert path.read_text() == "mine"
        assert sorted(p.name for p in here.iterdir()) == sorted(["boards", name])
        path.unlink()


def mirror(folder: Path) -> None:
    for path in folder.iterdir():
        image = cv2.imread(str(path))
        assert image is not None
        cv2.imwrite(str(path), np.ascontiguousarray(image[:, ::-1]))


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["--squares", "7x11"], "the markers fit a board 8 wide; say --squares 8x11"),
        (["--dictionary", "4x4"], "markers of 5x5 bits are seen; say --dictionary 5x5"),
        (["--board", "aprilgrid"], "an aprilgrid of 6x8 is found in none of its pictures, 3 are needed; ArUco markers"),
        (["--board", "chessboard"], "ArUco markers of 5x5 bits are seen; is it --board charuco?"),
    ],
)
def test_another_board_than_said(args: list[str], said: str, here: Path, capsys: Said) -> None:
    for path in sorted((here / "boards").iterdir())[4:]:
        path.unlink()
    assert run(["calibrate", "boards", "-o", "camera.yaml", *args]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == 1
    assert [path.name for path in here.iterdir()] == ["boards"]


def test_a_mirrored_board_and_none(here: Path, capsys: Said) -> None:
    for path in sorted((here / "boards").iterdir())[4:]:
        path.unlink()
    mirror(here / "boards")
    assert run(["calibrate", "boards", "-o", "camera.yaml"]) == 1
    assert "the pictures are mirrored" in capsys.readouterr().err
    for path in (here / "boards").iterdir():
        cv2.imwrite(str(path), np.full((480, 640, 3), 90, np.uint8))
    assert run(["calibrate", "boards", "-o", "camera.yaml"]) == 1
    assert "is found in none of its pictures, 3 are needed; nor is another board seen; film" in capsys.readouterr().err


def test_inner_corners_counted_for_squares(tmp_path: Path, capsys: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "chess"
    folder.mkdir()
    config = BoardClipConfig(Board("chessboard"), duration_s=1.8, fps=BoardClipConfig().fps * 2 / 9)
    for index, (image, _) in enumerate(film_board(config)):
        cv2.imwrite(str(folder / f"{index}.png"), image)
    assert run(["calibrate", "chess", "--board", "chessboard", "--squares", "7x10", "-o", "c.yaml"]) == 1
    assert "a chessboard of 8x11 squares is seen; --squares counts squares, not inner" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
def test_a_wrong_marker_and_too_few_rows_are_said(capsys: Said) -> None:
    assert run(["calibrate", "boards", "-o", "camera.yaml", "--marker", "0.012", "--squares", "8x9"]) in (0, 3)
    out, err = capsys.readouterr()
    assert re.search(r"markers are 0\.7\d of a square, 0\.60 was said; say --marker 0\.01[45]", err)
    assert "a board of 8x9 ends at 35; check --squares" in err
    assert "verdict: good" not in out


@pytest.mark.parametrize(
    ("args", "code", "said"),
    [
        (["none.mp4", "-o", "c.yaml"], 2, "none.mp4: does not exist"),
        (["boards"], 2, "missing option '-o' / '--output'"),
        (["boards", "-o", "boards"], 2, "boards: is the input itself"),
        (["boards", "-o", "c.yaml", "--board", "round"], 2, "no board 'round'; known: chessboard, charuco, aprilgrid"),
        (["boards", "-o", "c.yaml", "--board", "b.toml"], 1, "b.toml: holds no board's kind"),
        (["boards", "-o", "c.yaml", "--board", "pad.toml"], 1, "pad.toml: describes a landing pad, not a board"),
        (["boards", "-o", "c.yaml", "--squares", "8"], 2, "'8' is no size of a board"),
        (["boards", "-o", "c.yaml", "--spacing", "0.3"], 2, "--spacing is read only with --board aprilgrid"),
        (["boards", "-o", "c.yaml", "--marker", "0.5"], 2, "markers of 0.5 m in squares of 0.02 m"),
        (["boards", "-o", "c.yaml", "--square", "nan"], 2, "invalid value for '--square'"),
    ],
)
def test_what_it_refuses(args: list[str], code: int, said: str, here: Path, capsys: Said) -> None:
    (here / "b.toml").write_text("columns = 3\n")
    (here / "pad.toml").write_text(PadSpec().to_toml())
    assert run(["calibrate", *args]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err
    assert err.count("\n") == 1
    assert sorted(path.name for path in here.iterdir()) == ["b.toml", "boards", "pad.toml"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_printed_board_is_true_to_scale_and_found(kind: str, tmp_path: Path, capsys: Said) -> None:
    output = tmp_path / "board.pdf"
    assert run(["pad", "--board", kind, "-o", str(output)]) == 0
    call = shlex.split(capsys.readouterr().out.splitlines()[-1].partition("landtool ")[2])
    assert call[:5] == ["calibrate", "INPUT", "-o", "camera.yaml", "--board"]
    px_per_mm = 5.0
    words = pypdfium2.PdfDocument(output)[0].get_textpage().get_text_range()
    assert f"landtool calibrate INPUT -o camera.yaml --board {kind}" in words
    page = pypdfium2.PdfDocument(output)[0].render(scale=px_per_mm * 25.4 / 72.0).to_numpy()
    # a little blur, as every camera has
    picture = np.asarray(cv2.GaussianBlur(np.ascontiguousarray(page[:, :, :3]), (7, 7), 0.8), np.uint8)
    board = Board.usual(kind)  # type: ignore[arg-type]
    view = find_board(picture, board).view
    assert view is not None
    assert len(view.ids) == len(board.points_m)
    first, last = (board.points_m[view.ids[i], :2] for i in (0, -1))
    # the renderer rounds the page up to whole pixels
    scale = np.array([picture.shape[1] / 210.0, picture.shape[0] / 297.0])
    measured = np.linalg.norm((view.pixels[-1] - view.pixels[0]) / scale)
    assert measured == pytest.approx(1000.0 * np.linalg.norm(last - first), abs=0.05)


@pytest.mark.parametrize("suffix", [".svg", ".png", ".toml"])
def test_a_board_in_other_formats(suffix: str, tmp_path: Path) -> None:
    output = tmp_path / f"board{suffix}"
    assert run(["pad", "--board", "charuco", "--squares", "5x7", "-o", str(output), "--dpi", "72"]) == 0
    if suffix == ".toml":
        assert Board.read(output) == Board("charuco", 5, 7)
    else:
        assert output.read_bytes().startswith({".svg": b"<?xml", ".png": b"\x89PNG"}[suffix])


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["--board", "charuco", "--squares", "12x20"], "a board of 240 x 400 mm does not fit the page of 210 x 297 mm"),
        (["--board", "charuco", "--diameter", "0.2"], "--pad and --diameter are the target's, not a board's"),
        (["--squares", "5x7"], "--squares is read only with --board; add --board KIND"),
    ],
)
def test_boards_that_are_not_printed(args: list[str], said: str, tmp_path: Path, capsys: Said) -> None:
    assert run(["pad", "-o", str(tmp_path / "b.pdf"), *args]) == 2
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_film_and_its_truth(tmp_path: Path, capsys: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    args = ["generate", "board", "--duration", "0.4", "--size", "160x120", "--lens", "fisheye", "--hfov", "120"]
    assert run([*args, "-o", "film.mp4"]) == 0
    assert "landtool calibrate film.mp4 --board film.toml -o camera.yaml" in capsys.readouterr().out
    assert read_camera(Path("film.camera.yaml")).model == "equidistant"
    assert run([*args, "-o", "again.mp4"]) == 0
    assert Path("film.mp4").read_bytes() == Path("again.mp4").read_bytes()
    for more, said in (
        (["-o", "film.mp4"], "exists already"),
        (["-o", "film.avi"], "is no kind of film"),
        (["-o", "b.mp4", "--lens", "plumb_bob"], "too wide for plumb_bob"),
    ):
        assert run([*args, *more]) == 2
        assert said in capsys.readouterr().err


def test_the_real_footage_of_a_moving_board(tmp_path: Path, capsys: Said) -> None:
    footage = shared_data("tags/wpilib/testcalibration.mp4")
    known = json.loads(shared_data("tags/wpilib/camera_fieldvideo.json").read_text())
    square = ["--squares", "12x8", "--square", "0.0180086", "--marker", "0.0139954"]
    assert run(["calibrate", str(footage), *square, "-o", str(tmp_path / "c.yaml")]) == 3
    assert "never tilted" in capsys.readouterr().err
    fx = json.loads((tmp_path / "c.json").read_text())["parameters"]["fx"]
    assert abs(fx["value"] - known["K"][0][0]) < 3 * fx["sigma"]
