"""JUnit XML as the parsers of CIs want it."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from landtool.errors import OutputExistsError, UsageError
from landtool.evaluate.baseline import Baseline
from landtool.evaluate.gate import GateResult, gate
from landtool.evaluate.junit import PartOutcome, junit_xml, refuse_other_file, write_junit
from landtool.evaluate.tolerance import Allowance, Tolerance
from tests.unit.evaluate.metrics import made

TENTH = Tolerance((("*", Allowance(relative=0.1)), ("*:*", Allowance(relative=0.1))))
PARTS = [
    PartOutcome("stills", 1.25),
    PartOutcome('a <"&\x07\ud800> clip', 0.5, "a.mp4: cannot be decoded; get it again"),
]
COUNTS = ("tests", "failures", "errors", "skipped")


def compared() -> GateResult:
    kept = [made("pose.a", 1.0), made("pose.b", 1.0), made("pose.c", None), made("track.d:size_px=0-14", 1.0)]
    now = [made("pose.a", 1.5), made("pose.c", None), made("track.d:size_px=0-14", 1.0), made("track.e", 1.0)]
    return gate(Baseline("", "", tuple(kept)), now, TENTH, same_data=True)


def counts(element: ElementTree.Element) -> list[int]:
    return [int(element.attrib[name]) for name in COUNTS]


def test_a_suite_a_stage_and_a_case_a_number() -> None:
    root = ElementTree.fromstring(junit_xml(PARTS, compared(), seconds={"pose": 3.0}))
    suites = {suite.attrib["name"]: suite for suite in root}
    assert list(suites) == ["landtool eval: dataset", "landtool eval: pose", "landtool eval: track"]
    assert (root.tag, {suite.tag for suite in root}) == ("testsuites", {"testsuite"})
    assert [counts(suite) for suite in suites.values()] == [[2, 0, 1, 0], [3, 2, 0, 1], [2, 0, 0, 0]]
    assert counts(root) == [7, 2, 1, 1]
    assert [suite.attrib["time"] for suite in root] == ["1.750", "3.000", "0.000"]
    cases = {case.attrib["name"]: case for case in root.iter("testcase")}
    assert cases["a"].attrib["classname"] == "landtool.pose"
    failure = cases["a"].find("failure")
    assert failure is not None
    assert (failure.attrib["type"], failure.text) == ("worse", "was 1, is 1.5, worse by 0.5, allowed are 0.1")
    gone = cases["b"].find("failure")
    assert gone is not None
    assert gone.attrib == {"message": "was 1, is undefined", "type": "gone"}
    assert cases["c"].find("skipped") is not None
    assert [child.tag for child in cases["d:size_px=0-14"]] == ["system-out"]


def test_what_xml_cannot_say_is_replaced() -> None:
    root = ElementTree.fromstring(junit_xml(PARTS))
    (suite,) = root
    assert [case.attrib["name"] for case in suite] == ["stills", 'a <"&??> clip']
    error = suite[1].find("error")
    assert error is not None
    assert error.attrib["message"] == "a.mp4: cannot be decoded; get it again"


def test_every_case_says_its_time() -> None:
    root = ElementTree.fromstring(junit_xml(PARTS, compared()))
    assert all(float(element.attrib["time"]) >= 0.0 for element in root.iter() if element.tag.startswith("test"))


def test_of_nothing() -> None:
    root = ElementTree.fromstring(junit_xml([]))
    assert counts(root) == [0, 0, 0, 0]


def test_the_file(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "junit.xml"
    write_junit(path, PARTS, compared())
    assert path.read_bytes().startswith(b"<?xml version='1.0' encoding='utf-8'?>\n<testsuites ")
    with pytest.raises(OutputExistsError):
        write_junit(path, PARTS)
    write_junit(path, PARTS, overwrite=True)
    assert path.read_bytes() == junit_xml(PARTS)


def test_only_junit_is_replaced(tmp_path: Path) -> None:
    for name, content in {"clip.mp4": b"\x00\x00\x00\x18ftyp", "notes.txt": b"mine", "page.xml": b"<html/>"}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(UsageError, match="no JUnit XML"):
            refuse_other_file(tmp_path / name)
    write_junit(tmp_path / "junit.xml", PARTS)
    refuse_other_file(tmp_path / "junit.xml")
    refuse_other_file(tmp_path / "new.xml")
