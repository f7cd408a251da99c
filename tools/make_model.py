"""Train the shipped network from nothing: draw its pictures, train it twice, export, score.

`python tools/make_model.py [--backgrounds DIR]... [--out runs/model]`, or `make model`. About two and a half hours on
two cores, a fifth of it for the pictures. Interrupted, the same command goes on where it stopped. The network is put
into landtool/models only at the end, when the gate of the export has passed; its card is written by hand.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SHIPPED = ROOT / "landtool" / "models" / "pad-tiny-yolov3.onnx"
# More signs and bare grounds than in the default domain: what a far eye must not take for the pad
PADS = "absent = 0.2\nsigns_without_pad = 0.7\nsigns_with_pad = 0.5\nocclusion = 0.15\n"
SIGNS = "absent = 0.5\nsigns_without_pad = 1.0\nsigns_with_pad = 0.8\n"
FAR = "height_m = [2.5, 30.0]\nfog = 0.45\nshadow = 0.35\nabsent = 0.2\nsigns_without_pad = 0.8\nsigns_with_pad = 0.6\n"
# how many, of which seed, from which domain
DATASETS = {"pads": (12000, 1001, PADS), "signs": (3000, 2002, SIGNS), "far": (6000, 3003, FAR)}
SPLIT = "0.96,0.04,0"


@dataclass(frozen=True)
class Training:
    """One of the trainings: its folder, the sets it learns from and is validated on, and what differs from default."""

    name: str
    train: tuple[str, ...]
    val: tuple[str, ...]
    settings: str = ""


TRAININGS = (
    Training("first", ("pads", "signs"), ("pads",)),
    # the pictures are foggy, dim and noisy enough: to make more of them worse would drown what can just be seen
    Training(
        "second",
        ("pads", "signs", "far"),
        ("pads", "far"),
        "iterations = 1500\nlearning_rate = 0.0008\ndegrade = 0.2\n",
    ),
)


def main() -> int:
    """Make what is missing, in this order."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--backgrounds", action="append", default=[], help="photographs to lay under the pad")
    parser.add_argument("--out", type=Path, default=ROOT / "runs" / "model")
    options = parser.parse_args()
    began = time.monotonic()
    make_pictures(options.out, options.backgrounds)
    best = train(options.out)
    export(options.out, best)
    print(f"{SHIPPED}: made in {(time.monotonic() - began) / 60.0:.0f} min", flush=True)
    return subprocess.call([sys.executable, ROOT / "tools" / "score_model.py", SHIPPED])


def make_pictures(out: Path, backgrounds: list[str]) -> None:
    """Draw the sets that are not there yet."""
    out.mkdir(parents=True, exist_ok=True)
    places = [word for place in backgrounds for word in ("--backgrounds", place)]
    for name, (count, seed, domain) in DATASETS.items():
        if (out / name).exists():
            continue
        config = out / f"{name}.toml"
        config.write_text(f"[domain]\n{domain}", encoding="utf-8")
        asked = ("-n", count, "--seed", seed, "--split", SPLIT, "--config", config, *places)
        landtool("generate", "images", "-o", out / name, *asked)


def train(out: Path) -> Path:
    """Do the trainings that are not done yet, each from the weights of the one before; return the last best weights."""
    best: Path | None = None
    for training in TRAININGS:
        run = out / training.name
        if not (run / "run.json").exists():
            config = out / f"{training.name}.toml"
            config.write_text(training.settings, encoding="utf-8")
            start = ("--weights", best) if best else ()
            landtool("train", "--data", data_of(out, training), "-o", run, "--config", config, *start)
        best = run / "weights" / "best.landtool"
    assert best is not None
    return best


def data_of(out: Path, training: Training) -> Path:
    """Write the data.yaml that joins the sets of a training, and return its path."""
    lines = ["train:", *(f"  - {name}/images/train" for name in training.train)]
    lines += ["val:", *(f"  - {name}/images/val" for name in training.val), "names:", "  0: pad", ""]
    path = out / f"{training.name}.yaml"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def export(out: Path, best: Path) -> None:
    """Export the best network in eight bits, and put it in the place of the shipped one.

    Its scales are chosen by faint pictures, and what rounding costs is measured on the common kind: on the faint ones
    it costs more than the half point that an export allows.
    """
    made, val = out / SHIPPED.name, data_of(out, TRAININGS[0])
    landtool("export", best, "-o", made, "--int8", "--calibration", out / "far", "--val", val, "--overwrite")
    SHIPPED.parent.mkdir(exist_ok=True)
    shutil.copyfile(made, SHIPPED)


def landtool(*words: object) -> None:
    """Run a command of landtool; its failure ends this program with its code."""
    program = [str(Path(sys.executable).parent / "landtool"), *map(str, words), "-v"]
    print("landtool", *words, flush=True)
    code = subprocess.call(program, cwd=ROOT)
    if code:
        sys.exit(code)


if __name__ == "__main__":
    sys.exit(main())
