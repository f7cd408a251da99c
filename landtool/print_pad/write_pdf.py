"""Sheets as a PDF, one page each."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import Any

from landtool import __version__
from landtool.print_pad.sheet import Area, Disc, Picture, Sheet, Text, outlines

_MM = 72.0 / 25.4  # a PDF counts in points
_NON_ZERO = 1


def write_pdf(sheets: Sequence[Sheet], title: str) -> bytes:
    """Return the sheets as a PDF at true scale; its viewer is asked not to scale when printing."""
    from reportlab.pdfgen.canvas import Canvas  # slow to import

    file = BytesIO()
    canvas = Canvas(file, invariant=True)  # no date and no random id: same sheets, same bytes
    canvas.setTitle(_latin(title))
    canvas.setCreator(f"landtool {__version__}")
    canvas.setViewerPreference("PrintScaling", "None")
    for sheet in sheets:
        _draw_sheet(canvas, sheet)
        canvas.showPage()
    canvas.save()
    return file.getvalue()


def _draw_sheet(canvas: Any, sheet: Sheet) -> None:
    canvas.setPageSize((sheet.width_mm * _MM, sheet.height_mm * _MM))
    # from points and upwards to mm and downwards; text is turned back where it is drawn
    canvas.transform(_MM, 0, 0, -_MM, 0, sheet.height_mm * _MM)
    canvas.saveState()
    clip = canvas.beginPath()
    clip.rect(*sheet.window)
    canvas.clipPath(clip, stroke=0, fill=0)
    for item in sheet.picture:
        _draw(canvas, item)
    canvas.restoreState()
    for part in sheet.margin:
        _draw(canvas, part)


def _draw(canvas: Any, item: Picture | Text) -> None:
    if isinstance(item, Text):
        _draw_text(canvas, item)
        return
    canvas.setFillColorRGB(*(value / 255.0 for value in item.color))
    if isinstance(item, Disc):
        canvas.circle(item.x, item.y, item.radius, stroke=0, fill=1)
    else:
        canvas.drawPath(_path(canvas, item), stroke=0, fill=1, fillMode=_NON_ZERO)


def _path(canvas: Any, area: Area) -> Any:
    path = canvas.beginPath()
    for loop in outlines(area):
        path.moveTo(*loop[0].tolist())
        for point in loop[1:]:
            path.lineTo(*point.tolist())
        path.close()
    return path


def _draw_text(canvas: Any, text: Text) -> None:
    canvas.saveState()
    canvas.setFillColorRGB(0, 0, 0)
    canvas.translate(text.x, text.y)
    canvas.scale(1, -1)
    canvas.setFont("Helvetica", text.size_mm)
    draw = canvas.drawCentredString if text.anchor == "middle" else canvas.drawString
    draw(0, 0, _latin(text.text))
    canvas.restoreState()


def _latin(text: str) -> str:
    """Keep what the PDF's built-in font has; everything else becomes a question mark."""
    return text.encode("latin-1", "replace").decode("latin-1")
