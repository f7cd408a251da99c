"""Change single keys of a cfg and leave the rest of its text as it is: comments, order and ends of lines."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from landtool.darknet.cfg import parse_cfg
from landtool.darknet.network import Network
from landtool.darknet.section import Section, sections
from landtool.errors import InputError

_VALUE = re.compile(r"([^=]*=\s*)([^#;]*?)(\s*(?:[#;].*)?)", re.DOTALL)  # key and =, value, what stands behind it


def edited(
    network: Network,
    *,
    width: int | None = None,
    height: int | None = None,
    letterbox: bool | None = None,
    pyramid: bool | None = None,
    anchors: Sequence[tuple[float, float]] | None = None,
) -> Network:
    """Return a network whose cfg says something else; None leaves a key as it is.

    width, height: of its input, pixels. anchors: all (width, height) in pixels that the masks of the heads choose
    from. Raises InputError when the changed cfg is none.
    """
    if anchors is not None and (wanted := _anchor_count(network.text)) != len(anchors):
        raise InputError(f"{len(anchors)} anchors where the cfg's masks choose from {wanted}")
    net = {
        "width": None if width is None else str(width),
        "height": None if height is None else str(height),
        "letter_box": None if letterbox is None else str(int(letterbox)),
        "pyramid": None if pyramid is None else str(int(pyramid)),
    }
    yolo = {"anchors": None if anchors is None else ", ".join(f"{w:g},{h:g}" for w, h in anchors)}
    lines = network.text.splitlines(keepends=True)
    # from below, so that a line put in moves none that is still to be changed
    for section in reversed(list(sections(network.text))):
        changes = {"net": net, "network": net, "yolo": yolo}.get(section.name, {})
        _change(lines, section, {key: value for key, value in changes.items() if value is not None})
    return parse_cfg("".join(lines))


def _anchor_count(text: str) -> int:
    return next(len(section.numbers("anchors")) // 2 for section in sections(text) if section.name == "yolo")


def _change(lines: list[str], section: Section, values: Mapping[str, str]) -> None:
    for key, value in values.items():
        if key in section.values:
            place = section.line_of(key) - 1
            match = _VALUE.fullmatch(lines[place])
            assert match is not None  # the line was read as key=value
            lines[place] = f"{match[1]}{value}{match[3]}"
    for key, value in values.items():
        if key not in section.values:
            head = lines[section.line - 1]
            end = head[len(head.rstrip("\r\n")) :] or "\n"
            lines.insert(section.line, f"{key}={value}{end}")
