"""Train the shipped network from nothing: draw its pictures, train, export, score.

`python tools/make_model.py [--backgrounds DIR]... [--out runs/model]`, or `make model`. About two hours on two cores,
a quarter of it for the pictures. Interrupted, the same command goes on where it stopped. The network is put into
landtool/models only at the end, when the gate of the export has passed; its card is written by hand.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SHIPPED = ROOT / "landtool" / "models" / "pad-tiny-yolov3.onnx"
# More signs and bare grounds than in the default domain: what a far eye must not take for the pad
DATASETS = {
    "pads": (12000, 1001, "absent = 0.2\nsigns_without_pad = 0.7\nsigns_with_pad = 0.5\nocclusion = 0.15\n"),
    "signs": (3000, 2002, "absent = 0.5\nsigns_without_pad = 1.0\nsigns_with_pad = 0.8\n"),
}
SPLIT = "0.96,0.04,0"
DATA = """train:
  - pads/images/train
  - signs/images/train
val: pads/images/val
names:
  0: pad
"""


def main() -> int:
    """Make what is missing, in this order."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--backgrounds", action="append", default=[], help="photographs to lay under the pad")
    parser.add_argument("--out", type=Path, default=ROOT / "runs" / "model")
    options = parser.parse_args()
    began = time.monotonic()
    make_pictures(options.out, options.backgrounds)
    run = options.out / "training"
    if not (run / "run.json").exists():
        landtool("train", "--data", options.out / "data.yaml", "-o", run)
    export(options.out, run)
    print(f"{SHIPPED}: made in {(time.monotonic() - began) / 60.0:.0f} min", flush=True)
    return subprocess.call([sys.executable, ROOT / "tools" / "score_model.py", SHIPPED])


def make_pictures(out: Path, backgrounds: list[str]) -> None:
    """Draw the two sets that are not there yet, and write the data.yaml that joins them."""
    out.mkdir(parents=True, exist_ok=True)
    places = [word for place in backgrounds for word in ("--backgrounds", place)]
    for name, (count, seed, domain) in DATASETS.items():
        if (out / name).exists():
            continue
        config = out / f"{name}.toml"
        config.write_text(f"[domain]\n{domain}", encoding="utf-8")
        landtool(
            "generate",
            "images",
            "-o",
            out / name,
            "-n",
            count,
            "--seed",
            seed,
            "--split",
            SPLIT,
            "--config",
            config,
            *places,
        )
    (out / "data.yaml").write_text(DATA, encoding="utf-8")


def export(out: Path, run: Path) -> None:
    """Export the best network in eight bits, and put it in the place of the shipped one."""
    made = out / SHIPPED.name
    data = out / "data.yaml"
    landtool(
        "export",
        run / "weights" / "best.landtool",
        "-o",
        made,
        "--int8",
        "--calibration",
        data,
        "--val",
        data,
        "--overwrite",
    )
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
