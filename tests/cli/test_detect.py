"""`landtool detect`: what it writes, says and returns, and what it refuses, with a network that boxes what is red."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from landtool.geometry import Array
from landtool.io.source import open_source
from landtool.io.tables import read_table
from landtool.pad import PadSpec
from landtool_cli.main import run
from tests.cli.conftest import Told
from tests.cli.landing import APPROACH, CAMERA, TIMES_NS, Landing, cut, snapshot, zeroed
from tests.red_box import SCORE, red_box

COUNT = len(TIMES_NS)
# design.md, section 3
COLUMNS = {
    "detections.csv": "frame,t_ns,label,score,x_min_px,y_min_px,x_max_px,y_max_px",
    "tags.csv": "frame,t_ns,family,tag_id,hamming,margin,x0_px,y0_px,x1_px,y1_px,x2_px,y2_px,x3_px,y3_px",
    "frames.csv": "frame,t_ns,file,status,haze,dehazed,stage,search,reason",
}
NET = ("--model", "red.onnx")
Detect = Callable[..., Told]


@pytest.fixture
def detect(here: Path, capfd: pytest.CaptureFixture[str]) -> Detect:
    """Return a function that calls `landtool detect` in a folder with clip.mp4 and red.onnx."""
    red_box(here / "red.onnx", widened_px=2.0)

    def call(*args: str) -> Told:
        capfd.readouterr()
        code = run(["detect", *args])
        return Told(code, *capfd.readouterr())

    return call


def boxes(folder: str | Path) -> Array:
    table = read_table(Path(folder) / "detections.csv")
    return np.column_stack([table.floats(name) for name in ("x_min_px", "y_min_px", "x_max_px", "y_max_px")])


def true_boxes() -> Array:
    """The tight boxes of the ring in the landing's pictures, clipped to them."""
    rings = [CAMERA.project(APPROACH.camera_T_pad(t_ns * 1e-9).apply(PadSpec().outline_m)) for t_ns in TIMES_NS]
    tight = np.array([[*ring.min(axis=0), *ring.max(axis=0)] for ring in rings])
    return np.clip(tight, -0.5, np.array([CAMERA.width, CAMERA.height] * 2) - 0.5)


def test_a_run_writes_every_file(detect: Detect, here: Path) -> None:
    before = snapshot(here)
    told = detect("clip.mp4", *NET)
    assert (told.code, told.err) == (0, "")
    folder = here / "runs/detect/clip"
    assert {path.name for path in folder.iterdir()} == {*COLUMNS, "annotated.mp4", "run.json"}
    for name, columns in COLUMNS.items():
        assert (folder / name).read_text().split("\n", 1)[0] == columns
    frames = read_table(folder / "frames.csv")
    assert frames.ints("frame") == list(range(COUNT))
    assert frames.ints("t_ns") == list(TIMES_NS) == [f.t_ns for f in open_source(folder / "annotated.mp4")]
    assert set(frames.texts("search")) == {"frame"}
    assert read_table(folder / "tags.csv").ints("tag_id") == [5] * COUNT
    found = read_table(folder / "detections.csv")
    assert set(found.texts("label")) == {"pad"}
    assert np.allclose(found.floats("score"), SCORE)
    assert snapshot(here, without=["runs"]) == before


def test_the_ring_makes_boxes_exact(detect: Detect) -> None:
    assert detect("clip.mp4", *NET, "-o", "ring", "--save", "csv", "--tags", "none").code == 0
    rough = ("--refine", "none", "--save", "csv", "--tags", "none")
    assert detect("clip.mp4", *NET, "-o", "rough", *rough).code == 0
    exact, given = (np.abs(boxes(f"{name}/clip") - true_boxes()).max(axis=1) for name in ("ring", "rough"))
    assert np.median(exact) < 0.3
    assert np.median(given) > 1.0


def test_a_run_says_what_it_found(detect: Detect) -> None:
    lines = detect("clip.mp4", *NET, "-o", "out", "--save", "csv").out.splitlines()
    assert lines[:5] == [
        "clip.mp4: out/clip",
        "  network red.onnx, input 640x480, layout yolov8",
        f"  frames {COUNT}, with a box {COUNT} (100.0%)",
        f"  boxes: pad {COUNT}; best score of a frame 0.90 to 0.90, mean 0.90",
        f"  tags read {COUNT}, in {COUNT} frames",
    ]
    assert lines[5].startswith("  ms a frame: dehaze ")
    assert ", tags " in lines[5]
    assert " frames/s over " in lines[6]


def test_the_record_tells_the_run_again(detect: Detect, here: Path) -> None:
    assert detect("clip.mp4", *NET, "-o", "out", "--conf", "0.5", "--save", "csv").code == 0
    record = json.loads((here / "out/clip/run.json").read_text())
    sums = snapshot(here)
    assert record["command"] == "detect"
    assert record["model"] == {"path": "red.onnx", "sha256": sums["red.onnx"]}
    assert [i["sha256"] for i in record["inputs"]] == [sums["clip.mp4"]]
    detector = record["config"]["detector"]
    assert (detector["conf"], detector["model"], record["config"]["search"]) == (0.5, "red.onnx", "frame")
    assert {"detect", "tags", "write"} <= set(record["timings"])


def test_regions_are_said_and_give_the_same_boxes(detect: Detect) -> None:
    # twice the picture's size, so that the region around the pad is a part of it
    big, config = Path("big"), ("--fps", "30", "--save", "csv", "--tags", "none")
    big.mkdir()
    for frame in open_source(Path("clip.mp4")):
        framed = np.full((960, 1280, 3), 30, np.uint8)
        framed[360:600, 480:800] = frame.image  # type: ignore[union-attr]
        assert cv2.imwrite(str(big / f"{frame.index:03d}.png"), framed)
    size = ("--imgsz", "1280x960")
    assert detect("big", *NET, "-o", "frame", *size, *config).code == 0
    told = detect("big", *NET, "-o", "region", *size, "--search", "region", *config)
    assert told.code == 0
    searches = read_table(Path("region/big/frames.csv")).texts("search")
    assert searches == ["frame"] + ["region"] * (COUNT - 1)
    assert f"  searched around the expected place in {COUNT - 1} frames\n" in told.out
    assert np.abs(boxes("frame/big") - boxes("region/big")).max() < 0.1


def test_images_without_a_clock(detect: Detect, landing: Landing, here: Path) -> None:
    landing.images(here / "shots")
    told = detect("shots", *NET, "-o", "out")
    assert (told.code, told.err) == (0, "")
    annotated = sorted((here / "out/shots/annotated").iterdir())
    assert [path.name for path in annotated] == [f"img{i}.png" for i in range(4)]
    drawn = cv2.imread(str(annotated[0]))
    assert drawn is not None
    assert (drawn != landing.pictures[0]).any()
    assert read_table(here / "out/shots/detections.csv").ints("t_ns") == [None] * 4
    assert read_table(here / "out/shots/tags.csv").ints("tag_id") == [5] * 4


def test_several_inputs_and_one_that_fails(detect: Detect, landing: Landing, here: Path) -> None:
    landing.images(here / "shots", 2)
    landing.log(here / "flight.mcap")
    (here / "text.mp4").write_text("no video")
    told = detect("clip.mp4", "text.mp4", "shots", "flight.mcap", *NET, "-o", "out", "--save", "csv")
    assert told.code == 3
    assert len(told.lines) == 1
    assert told.err.startswith("landtool: error: text.mp4: is no video that can be read")
    assert sorted(path.name for path in (here / "out").iterdir()) == ["clip", "flight", "shots"]
    assert len(boxes("out/flight")) == COUNT


def test_tags_none_reads_none(detect: Detect) -> None:
    told = detect("clip.mp4", *NET, "-o", "out", "--tags", "none", "--save", "csv")
    assert told.code == 0
    assert "tags" not in told.out
    assert len(read_table(Path("out/clip/tags.csv"))) == 0
    assert set(read_table(Path("out/clip/frames.csv")).texts("stage")) == {"far"}


def test_all_tags_of_a_family(detect: Detect, here: Path) -> None:
    (here / "pad.toml").write_text(PadSpec().to_toml().replace("id = 5", "id = 7"))
    for which, count in (("pad", 0), ("all", COUNT)):
        told = detect("clip.mp4", *NET, "--pad", "pad.toml", "--tags", which, "-o", which, "--save", "csv")
        assert told.code == 0
        assert read_table(here / which / "clip/tags.csv").ints("tag_id") == [5] * count


def test_other_peoples_classes_are_told_as_they_are(detect: Detect, here: Path) -> None:
    red_box(here / "signs.onnx", label="stop sign", size=(320, 256))
    told = detect("clip.mp4", "--model", "signs.onnx", "-o", "out", "--save", "csv")
    assert told.code == 0
    assert "  network signs.onnx, input 320x256, layout yolov8\n" in told.out
    assert set(read_table(here / "out/clip/detections.csv").texts("label")) == {"stop sign"}
    assert len(read_table(here / "out/clip/tags.csv")) == COUNT


def test_no_box_anywhere_is_said(detect: Detect) -> None:
    told = detect("clip.mp4", *NET, "-o", "out", "--conf", "0.95", "--save", "csv")
    assert told.code == 0
    assert told.err.count("\n") == 1
    assert "no box of a score of 0.95 or more in any frame; a lower --conf shows weaker ones" in told.err
    assert f"frames {COUNT}, with a box 0 (0.0%)" in told.out
    assert set(read_table(Path("out/clip/frames.csv")).texts("reason")) == {"no box"}


def test_settings_from_a_file(detect: Detect, here: Path) -> None:
    (here / "set").mkdir()
    (here / "red.onnx").rename(here / "set/red.onnx")
    text = 'save = "csv"\nrefine = "none"\n[detector]\nmodel = "red.onnx"\nconf = 0.3\nimgsz = [320, 256]\n'
    (here / "set/run.toml").write_text(text + '[tags]\nwhich = "none"\n')
    assert detect("clip.mp4", "--config", "set/run.toml", "-o", "out", "--conf", "0.4").code == 0
    config = json.loads((here / "out/clip/run.json").read_text())["config"]
    assert (config["detector"]["conf"], config["detector"]["imgsz"], config["refine"]) == (0.4, [320, 256], "none")
    assert not (here / "out/clip/annotated.mp4").exists()


def test_damage_and_loss_end_with_three(detect: Detect, landing: Landing, here: Path) -> None:
    folder = landing.images(here / "shots")
    (folder / "img1.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    zeroed(landing.remuxed(here / "hole.mp4", gop=1), 0.5, 0.02)
    for name in ("shots", "hole.mp4"):
        told = detect(name, *NET, "-o", "out", "--save", "csv")
        assert told.code == 3, told
        assert "landtool: warning: " in told.err
    frames = read_table(here / "out/shots/frames.csv")
    assert frames.texts("status") == ["ok", "damaged", "ok", "ok"]
    assert frames.texts("stage")[1] == ""


def test_one_small_picture_does_not_cost_the_others(detect: Detect, landing: Landing, here: Path) -> None:
    folder = landing.images(here / "shots", 2)
    assert cv2.imwrite(str(folder / "a.png"), np.zeros((2, 2, 3), np.uint8))
    told = detect("shots", *NET, "-o", "out", "--save", "csv")
    assert told.code == 3
    assert "pictures too small to be searched: 1" in told.err
    assert len(boxes("out/shots")) == 2


Make = Callable[[Landing, Path], object]


def nothing(*_: object) -> None:
    pass


def file(name: str, content: str | bytes) -> Make:
    data = content.encode() if isinstance(content, str) else content
    return lambda _, here: (here / name).write_bytes(data)


# what there is, what is typed after `landtool detect`, the exit code, and the line
BAD: dict[str, tuple[Make, str, int, str]] = {
    "no such model": (nothing, "clip.mp4 --model rad.onnx", 2, "rad.onnx: does not exist; did you mean red.onnx?"),
    "model is a folder": (lambda _, here: (here / "m").mkdir(), "clip.mp4 --model m", 2, "m: is a folder; "),
    "model is a video": (nothing, "clip.mp4 --model clip.mp4", 1, "clip.mp4: is "),
    "model is empty": (file("e.onnx", ""), "clip.mp4 --model e.onnx", 1, "e.onnx: is empty; "),
    "model is a page": (
        file("p.onnx", "<!DOCTYPE html><html></html>"),
        "clip.mp4 --model p.onnx",
        1,
        "p.onnx: is a web page, no ONNX model; ",
    ),
    "model is cut": (lambda _, here: cut(here / "red.onnx", 0.7), "clip.mp4 --model red.onnx", 1, "red.onnx: is cut"),
    "weights": (file("w.weights", bytes(range(256)) * 9), "clip.mp4 --model w.weights", 1, "w.weights: is "),
    "no multiple": (nothing, "clip.mp4 --model red.onnx --imgsz 600x480", 2, "red.onnx: an input of 600x480 is no mul"),
    "no size": (nothing, "clip.mp4 --model red.onnx --imgsz big", 2, "invalid value for '--imgsz': 'big' is no"),
    "size of none": (nothing, "clip.mp4 --model red.onnx --imgsz 0x0", 2, "imgsz = 0 is impossible; give 32 to 8192"),
    "another fixed size": (
        lambda _, here: red_box(here / "red.onnx", size=(320, 256)),
        "clip.mp4 --model red.onnx --imgsz 640x480",
        2,
        "red.onnx: its input is always 320x256 pixels; leave --imgsz out",
    ),
    "unknown layout": (nothing, "clip.mp4 --model red.onnx --layout yolo99", 2, "red.onnx: unknown layout 'yolo99'; "),
    "wrong layout": (nothing, "clip.mp4 --model red.onnx --layout darknet", 1, "red.onnx: its output output0 "),
    "conf of 2": (nothing, "clip.mp4 --model red.onnx --conf 2", 2, "invalid value for '--conf': 2.0 is not in"),
    "conf NaN": (nothing, "clip.mp4 --model red.onnx --conf nan", 2, "invalid value for '--conf': nan is not in"),
    "conf of 2 in settings": (
        file("run.toml", "[detector]\nconf = 2\n"),
        "clip.mp4 --model red.onnx --config run.toml",
        2,
        "run.toml: conf = 2 is impossible; give 0 to 1",
    ),
    "unknown setting": (
        file("run.toml", "[detector]\nconfidence = 0.2\n"),
        "clip.mp4 --model red.onnx --config run.toml",
        1,
        "run.toml: unknown key 'detector.confidence'; nearest known key is 'detector.conf'",
    ),
    "no threads": (nothing, "clip.mp4 --model red.onnx --threads 0", 2, "invalid value for '--threads': 0 is not in"),
    "family not read": (
        nothing,
        "clip.mp4 --model red.onnx --family tag25h9",
        2,
        "--family is read only with --tags all; ",
    ),
    "pad without tags": (
        file("pad.toml", "tags = []\n"),
        "clip.mp4 --model red.onnx --pad pad.toml",
        2,
        "pad.toml: the pad has no tag to read; add [[tags]] to it, or pass --tags none",
    ),
    "folder without images": (
        lambda _, here: (here / "shots").mkdir() or (here / "shots/a.txt").write_text("a"),
        "shots --model red.onnx",
        1,
        "shots: holds no images; ",
    ),
    "too small": (
        lambda _, here: cv2.imwrite(str(here / "a.png"), np.zeros((2, 2, 3), np.uint8)),
        "a.png --model red.onnx",
        1,
        "a.png: its pictures of 2x2 pixels are too small to show a pad; ",
    ),
    "no such input": (nothing, "clap.mp4 --model red.onnx", 2, "clap.mp4: does not exist; did you mean clip.mp4?"),
    "unknown output": (nothing, "clip.mp4 --model red.onnx --save gif", 2, "unknown output 'gif'; known: video, csv"),
    "output exists": (
        lambda _, here: (here / "out/clip").mkdir(parents=True) or (here / "out/clip/a").touch(),
        "clip.mp4 --model red.onnx",
        2,
        "out/clip: exists already; ",
    ),
    "output holds the model": (
        lambda _, here: (
            (here / "out/clip").mkdir(parents=True),
            (here / "out/clip/run.json").write_text("{}"),
            (here / "red.onnx").rename(here / "out/clip/red.onnx"),
        ),
        "clip.mp4 --model out/clip/red.onnx --overwrite",
        2,
        "out/clip: holds the input out/clip/red.onnx; choose another -o",
    ),
}


@pytest.mark.parametrize(("make", "typed", "code", "line"), BAD.values(), ids=list(BAD))
def test_one_line_and_nothing_left(
    make: Make, typed: str, code: int, line: str, detect: Detect, landing: Landing, here: Path
) -> None:
    make(landing, here)
    before = snapshot(here)
    told = detect(*typed.split(), "-o", "out")
    assert told.lines == [told.err.strip()]
    assert told.err.startswith(f"landtool: error: {line}")
    assert told.err.partition("; ")[2].strip(), "it must say what to do"
    assert (told.code, told.out) == (code, "")
    assert snapshot(here) == before


def test_a_network_that_gives_nonsense_fails_whole(detect: Detect, here: Path) -> None:
    data = (here / "red.onnx").read_bytes()
    good, bad = np.float32(SCORE).tobytes(), np.float32(np.inf).tobytes()
    assert data.count(good) == 1
    (here / "red.onnx").write_bytes(data.replace(good, bad))
    told = detect("clip.mp4", *NET, "-o", "out")
    assert told.code == 1
    assert len(told.lines) == 1
    assert told.err.startswith("landtool: error: red.onnx: ")
    assert not (here / "out").exists() or not any((here / "out").iterdir())


def test_help_does_not_load_the_network_s_runtime() -> None:
    script = (
        "import sys\nfrom landtool_cli.main import run\nrun(['detect', '--help'])\n"
        "sys.exit(' '.join({'onnxruntime', 'onnx', 'torch', 'matplotlib'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == "", done.stderr
    assert "--search" in done.stdout


def test_dehaze_says_when(detect: Detect) -> None:
    for when, hazy, dehazed in (("off", False, "0"), ("on", True, "1"), ("auto", True, "0")):
        told = detect("clip.mp4", *NET, "-o", when, "--save", "csv", "--tags", "none", "--dehaze", when)
        assert (told.code, told.err) == (0, "")
        frames = read_table(Path(when) / "clip/frames.csv")
        assert set(frames.texts("dehazed")) == {dehazed}
        assert all(bool(haze) == hazy for haze in frames.texts("haze"))
        assert (f"{COUNT} of {COUNT} frames dehazed" in told.out) == (when == "on")
