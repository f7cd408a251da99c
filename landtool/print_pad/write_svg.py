"""A sheet as SVG, in millimetres."""

from __future__ import annotations

from xml.sax.saxutils import escape

import numpy as np

from landtool.pad import Color
from landtool.print_pad.sheet import Area, Disc, Picture, Sheet, Text, outlines


def write_svg(sheet: Sheet, title: str) -> bytes:
    """Return the sheet as SVG: one user unit is one millimetre."""
    width, height = _number(sheet.width_mm), _number(sheet.height_mm)
    size = f'width="{width}mm" height="{height}mm" viewBox="0 0 {width} {height}"'
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" {size}>',
        f"<title>{_text(title)}</title>",
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>',
        *(_element(item) for item in (*sheet.picture, *sheet.margin)),
        "</svg>",
    ]
    return ("\n".join(lines) + "\n").encode()


def _element(item: Picture | Text) -> str:
    if isinstance(item, Disc):
        x, y, r = (_number(value) for value in (item.x, item.y, item.radius))
        return f'<circle cx="{x}" cy="{y}" r="{r}" fill="{_color(item.color)}"/>'
    if isinstance(item, Area):
        return f'<path fill="{_color(item.color)}" fill-rule="nonzero" d="{_path(item)}"/>'
    place = f'x="{_number(item.x)}" y="{_number(item.y)}" text-anchor="{item.anchor}"'
    font = f'font-family="Helvetica, Arial, sans-serif" font-size="{_number(item.size_mm)}"'
    return f"<text {place} {font}>{_text(item.text)}</text>"


def _path(area: Area) -> str:
    loops = [[f"{_number(x)} {_number(y)}" for x, y in loop] for loop in outlines(area)]
    return " ".join(f"M{' L'.join(loop)} Z" for loop in loops)


def _number(value: float) -> str:
    """Return a length to a tenth of a micrometre, without an exponent."""
    return np.format_float_positional(value, precision=4, trim="-")


def _color(color: Color) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)


def _text(text: str) -> str:
    """Return text as XML allows it: control characters are none."""
    return escape("".join(character for character in text if character.isprintable()))
