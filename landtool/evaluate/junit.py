"""The outcome of an evaluation as JUnit XML, which every CI shows: a suite a stage, a case a number."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from landtool.errors import UsageError
from landtool.evaluate.gate import FAILS, GateResult, GateRow, row_text
from landtool.io.atomic import atomic_path

_SUITES = "landtool eval"
_DATASET = "dataset"
# XML 1.0 has no place for these, however they are written
_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass(frozen=True)
class PartOutcome:
    """A part of the dataset. failure: why it could not be scored, empty where it was."""

    name: str
    seconds: float = 0.0
    failure: str = ""


def write_junit(
    path: Path,
    parts: Sequence[PartOutcome],
    result: GateResult | None = None,
    *,
    seconds: Mapping[str, float] | None = None,
    overwrite: bool = False,
) -> None:
    """Write JUnit XML: a case a part of the dataset and, with a comparison, a case a number that was compared.

    A number that got worse or is gone is a failure, one that is undefined as it was before is skipped, a part that
    could not be scored is an error. seconds: what each stage took. Raises OutputError as `atomic_path` does.
    """
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(junit_xml(parts, result, seconds=seconds))


def refuse_other_file(path: Path) -> None:
    """Raise UsageError for a file that is there and no JUnit XML: it would be replaced by one."""
    if not path.is_file():
        return
    try:
        is_junit = ElementTree.parse(path).getroot().tag in ("testsuites", "testsuite")
    except (OSError, ElementTree.ParseError):
        is_junit = False
    if not is_junit:
        raise UsageError("is no JUnit XML, and would be replaced by one", file=path, hint="choose another --junit")


def junit_xml(
    parts: Sequence[PartOutcome], result: GateResult | None = None, *, seconds: Mapping[str, float] | None = None
) -> bytes:
    """Return the XML of `write_junit`, UTF-8."""
    root = ElementTree.Element("testsuites", name=_SUITES)
    cases = [_part_case(part) for part in parts]
    suites = [_suite(root, _DATASET, cases, sum(part.seconds for part in parts))]
    stages: dict[str, list[GateRow]] = {}
    for row in result.rows if result else ():
        stages.setdefault(row.key.partition(".")[0], []).append(row)
    for stage, rows in stages.items():
        suites.append(_suite(root, stage, map(_row_case, rows), (seconds or {}).get(stage, 0.0)))
    for name in ("tests", "failures", "errors", "skipped"):
        root.set(name, str(sum(int(suite.get(name, "0")) for suite in suites)))
    root.set("time", _time(sum(part.seconds for part in parts)))
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _suite(
    root: ElementTree.Element, name: str, cases: Iterable[ElementTree.Element], seconds: float
) -> ElementTree.Element:
    suite = ElementTree.SubElement(root, "testsuite", name=f"{_SUITES}: {name}")
    suite.extend(cases)
    suite.set("tests", str(len(suite)))
    for plural, child in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(plural, str(len(suite.findall(f"testcase/{child}"))))
    suite.set("time", _time(seconds))
    return suite


def _part_case(part: PartOutcome) -> ElementTree.Element:
    case = _case(_DATASET, part.name, part.seconds)
    if part.failure:
        _tell(case, "error", part.failure, "not scored")
    return case


def _row_case(row: GateRow) -> ElementTree.Element:
    stage, _, name = row.key.partition(".")
    case, text = _case(stage, name, 0.0), row_text(row)
    if row.verdict in FAILS:
        _tell(case, "failure", text, row.verdict)
    elif row.value is None:
        ElementTree.SubElement(case, "skipped", message=text)
    else:
        ElementTree.SubElement(case, "system-out").text = text
    return case


def _case(suite: str, name: str, seconds: float) -> ElementTree.Element:
    values = {"classname": f"landtool.{suite}", "name": _clean(name), "time": _time(seconds)}
    return ElementTree.Element("testcase", values)


def _tell(case: ElementTree.Element, kind: str, text: str, sort: str) -> None:
    said = _clean(text)
    ElementTree.SubElement(case, kind, message=said, type=sort).text = said


def _clean(text: str) -> str:
    return _FORBIDDEN.sub("?", text)


def _time(seconds: float) -> str:
    return f"{seconds:.3f}"
