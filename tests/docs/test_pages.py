"""What the pages say of the code is so: links, generated parts, columns, keys, modules, pictures."""

from __future__ import annotations

import importlib.util
import json
import re
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
import pytest

from landtool.config import DehazeCommandConfig, DetectConfig, EvalConfig, GenerateConfig, TrackConfig
from landtool.dehaze.config import DehazeConfig, PaperConfig
from landtool.detect.config import DetectorConfig
from landtool.detect.layouts import LAYOUTS
from landtool.evaluate.record import METRIC_COLUMNS, EvalRecord, write_record
from landtool.inspect.facts import Facts
from landtool.io.poses import CSV_COLUMNS, STRAIGHT_DOWN, read_mount
from landtool.io.run_record import Counts, RunRecord, StageTime
from landtool.io.tables import TABLES
from landtool.pad import Board, Letter, PadSpec, PadTag, QuietZone, Ring
from landtool.run.scores import ERROR_TABLES
from landtool.synth.clips import SCENARIOS, SIDE_FILES
from landtool.synth.clips.recording import IMAGE_TOPIC, ODOMETRY_TOPIC, POSE_TOPIC, TF_TOPIC, TRUTH_TOPICS
from landtool.synth.clips.tables import TRUTH_COLUMNS as CLIP_TRUTH_COLUMNS
from landtool.synth.dataset import TRUTH_COLUMNS
from landtool.synth.domain import Domain
from tests.docs.conftest import DOCS, PAGES
from tests.shared import ROOT

FORMATS = (DOCS / "formats.md").read_text(encoding="utf-8")
MOST_PICTURE_BYTES = 800_000
EVALUATION = {"metrics.csv": METRIC_COLUMNS, **{name: table.columns for name, (_, table) in ERROR_TABLES.items()}}
UNITS = (
    ("_per_m", "1/m"),
    ("_px", "px"),
    ("_m", "m"),
    ("_ns", "ns"),
    ("_mps", "m/s"),
    ("_m2", "m^2"),
    ("_deg", "deg"),
    ("_db", "dB"),
)
PARTS = {"board": Board, "ring": Ring, "letter": Letter, "quiet_zone": QuietZone, "tags": PadTag}


@pytest.fixture(scope="module")
def make_docs() -> ModuleType:
    return load(ROOT / "tools" / "make_docs.py")


def load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings as GitHub makes them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def section(title: str) -> str:
    """Return the text below a heading of formats.md, up to the next one."""
    found = re.search(rf"^##+ {re.escape(title)}\n(.*?)(?=^##|\Z)", FORMATS, re.MULTILINE | re.DOTALL)
    assert found, f"formats.md has no section '{title}'"
    return found[1]


def rows(text: str) -> list[list[str]]:
    """Return the cells of a table's rows, head and rule left out."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


@pytest.mark.parametrize("page", [*PAGES, ROOT / "datasets" / "README.md"], ids=lambda p: f"{p.parent.name}/{p.name}")
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        assert path.exists(), f"{page.name}: {target}"
        assert not anchor or anchor in anchors(path), f"{page.name}: {target}"


def test_every_page_is_in_the_index() -> None:
    linked = set(re.findall(r"\]\((\w+\.md)\)", (DOCS / "index.md").read_text(encoding="utf-8")))
    assert {page.name for page in DOCS.glob("*.md")} - {"index.md"} <= linked


def test_generated_parts_are_fresh(make_docs: ModuleType) -> None:
    pages = make_docs.pages()
    assert {path.name for path in pages} >= {"cli.md", "conventions.md", "formats.md", "architecture.md"}
    stale = [path.name for path, text in pages.items() if path.read_text(encoding="utf-8") != text]
    assert not stale, f"run python tools/make_docs.py: {', '.join(stale)}"
    used = {name for path in pages for name in re.findall(r"<!-- begin (.+) -->", path.read_text(encoding="utf-8"))}
    assert used == set(make_docs.PARTS)


def test_every_setting_is_explained(make_docs: ModuleType) -> None:
    tables = (type(TrackConfig().tags), type(TrackConfig().tracker), DetectorConfig, Domain, DehazeConfig, PaperConfig)
    for kind in (TrackConfig, DetectConfig, EvalConfig, GenerateConfig, DehazeCommandConfig, *tables):
        said = make_docs.field_comments(kind)
        unsaid = [f.name for f in fields(kind) if not said.get(f.name)]
        assert not unsaid, f"{kind.__name__} has no comment above {', '.join(unsaid)}"


def test_every_layout_of_networks_is_explained() -> None:
    text = (DOCS / "detect.md").read_text(encoding="utf-8").split("## Other people's networks")[1]
    assert [name for row in rows(text.split("\n## ")[0]) for name in row[0].split(", ")] == list(LAYOUTS)


@pytest.mark.parametrize("name", [*TABLES, *EVALUATION])
def test_every_column_is_explained(name: str) -> None:
    documented = rows(section(name))
    assert [row[0] for row in documented] == list(EVALUATION.get(name) or TABLES[name].columns)
    meaning = ""
    for column, unit, text in documented:
        # a pair or a quaternion is explained at its first column
        meaning = text or meaning
        assert meaning, column
        assert unit == next((wanted for ending, wanted in UNITS if column.endswith(ending)), unit), column


def test_every_table_of_an_evaluation_is_explained() -> None:
    text = FORMATS.split("## What `landtool eval` writes")[1].split("\n## ")[0]
    assert set(re.findall(r"^### (\w+\.csv)$", text, re.MULTILINE)) == set(EVALUATION)


def test_every_key_of_metrics_json_is_explained(tmp_path: Path) -> None:
    write_record(tmp_path, EvalRecord("clips", "", (), {}, (), ()))
    documented = [row[0] for row in rows(section("metrics.json"))]
    assert documented == list(json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8")))


def test_every_column_of_the_truth_is_explained() -> None:
    text = (DOCS / "generate.md").read_text(encoding="utf-8").split("### truth.csv")[1].split("\n#")[0]
    named = [name for row in rows(text) for name in row[0].split(", ")]
    assert named == list(TRUTH_COLUMNS)
    assert all(row[2] for row in rows(text))


def test_every_column_of_a_clips_truth_is_explained() -> None:
    text = (DOCS / "generate.md").read_text(encoding="utf-8").split("#### Clip truth columns")[1].split("\n#")[0]
    named = [name for row in rows(text) for name in row[0].split(", ")]
    assert named == list(CLIP_TRUTH_COLUMNS)
    assert all(row[2] for row in rows(text))


def test_every_scenario_and_topic_of_a_clip_is_explained() -> None:
    text = (DOCS / "generate.md").read_text(encoding="utf-8").split("\n## Clips")[1]
    first = {name for row in rows(text) for name in row[0].split(", ")}
    assert set(SCENARIOS) <= first
    assert {IMAGE_TOPIC, TF_TOPIC, ODOMETRY_TOPIC, POSE_TOPIC, *TRUTH_TOPICS.values()} <= first
    assert {f"landing.{ending}" for ending in SIDE_FILES} <= first


def test_every_key_of_run_json_is_explained() -> None:
    documented = {row[0]: row[1] for row in rows(section("run.json"))}
    assert set(documented) == {"schema_version", *(f.name for f in fields(RunRecord))}
    for key, kind in (("counts", Counts), ("timings", StageTime)):
        for field in fields(kind):
            assert f"`{field.name}`" in documented[key], field.name


def test_every_key_of_a_pad_file_is_explained() -> None:
    documented = {name for row in rows(section("Pad file")) for name in row[0].split(", ")}
    keys = {f"{table}.{f.name}" for table, kind in PARTS.items() for f in fields(kind)}
    assert documented == keys | {"name", "diameter_m"}
    assert {f.name for f in fields(PadSpec)} == {"name", "diameter_m", *PARTS}


def test_other_files_keys_are_named() -> None:
    assert ", ".join(CSV_COLUMNS) in FORMATS
    for field in fields(Facts):
        assert f"`{field.name}`" in section("`landtool info --json`"), field.name


def test_the_mount_file_shown_is_the_default(recordings: Path) -> None:
    shown = read_mount(recordings / "mount.toml")
    assert np.allclose(shown.rotation, STRAIGHT_DOWN.rotation, atol=1e-7)
    assert np.array_equal(shown.translation, STRAIGHT_DOWN.translation)


def modules() -> Iterator[str]:
    for path in (ROOT / "landtool").iterdir():
        if path.suffix == ".py" and path.name != "__init__.py":
            yield path.stem
        elif (path / "__init__.py").exists():
            yield path.name


def test_every_module_has_its_layer_in_the_order_shown(make_docs: ModuleType) -> None:
    shown = re.findall(r"\w+", make_docs.import_order().replace("```text", ""))
    assert sorted(shown) == sorted([*modules(), "landtool_cli"])


def test_every_module_says_what_it_is(make_docs: ModuleType) -> None:
    lines = make_docs.module_tree().splitlines()[1:-1]
    silent = [line for line in lines if len(line.split()) < 3]
    assert not silent


def test_pictures_are_small_and_used() -> None:
    pictures = sorted((DOCS / "pictures").iterdir())
    texts = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert all(f"pictures/{path.name}" in texts for path in pictures)
    assert sum(path.stat().st_size for path in pictures) < MOST_PICTURE_BYTES


@pytest.mark.parametrize(("name", "draw"), [("frames", "frames"), ("pad", "pad_axes")])
def test_drawings_are_fresh(name: str, draw: str) -> None:
    drawn = getattr(load(ROOT / "tools" / "make_docs_pictures.py"), draw)()
    stored = cv2.imread(str(DOCS / "pictures" / f"{name}.png"))
    assert stored is not None
    # the stored one has a palette, and machines round differently
    assert np.abs(stored.astype(int) - drawn).mean() < 2.0, "run python tools/make_docs.py --pictures"


def test_messages_quoted_are_the_programs_own() -> None:
    source = "".join(
        path.read_text(encoding="utf-8") for top in ("landtool", "cli") for path in (ROOT / top).rglob("*.py")
    )
    text = (DOCS / "troubleshooting.md").read_text(encoding="utf-8")
    text = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)  # examples are run
    quoted = [" ".join(q.split()) for q in re.findall(r"`([^`]+)`", text)]
    messages = [q for q in quoted if " " in q and not q.startswith(("landtool ", "--", "mcap "))]
    messages += [message for row in rows(text) for message in row[0].split(" / ")]
    assert len(messages) > 10
    for message in messages:
        for part in message.split("..."):
            assert part.strip() in source, message
