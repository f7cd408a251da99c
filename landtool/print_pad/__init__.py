"""The landing target for printing, at true scale, as PDF, SVG or PNG."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from landtool.errors import UsageError
from landtool.pad import PadSpec
from landtool.print_pad.layout import PAGES, Layout, lay_out
from landtool.print_pad.sheet import Sheet
from landtool.print_pad.write_pdf import write_pdf
from landtool.print_pad.write_png import DPI_RANGE, write_png
from landtool.print_pad.write_svg import write_svg

# pad.md's print: the largest round size that A4 and Letter hold
PRINT_DIAMETER_M = 0.18


@dataclass(frozen=True)
class PadPrint:
    """A target ready for the printer: a file's content, the size of its sheets in mm and how they are arranged.

    More than one row or column: the target is spread over that many sheets, row by row from the top left.
    """

    data: bytes
    width_mm: float
    height_mm: float
    rows: int
    columns: int


def _pdf(layout: Layout, dpi: int) -> bytes:  # noqa: ARG001 (its lines have no resolution)
    return write_pdf(layout.sheets, layout.title)


def _svg(layout: Layout, dpi: int) -> bytes:  # noqa: ARG001
    return write_svg(_only(layout), layout.title)


def _png(layout: Layout, dpi: int) -> bytes:
    return write_png(_only(layout), dpi)


def _only(layout: Layout) -> Sheet:
    (sheet,) = layout.sheets
    return sheet


FORMATS: dict[str, Callable[[Layout, int], bytes]] = {".pdf": _pdf, ".svg": _svg, ".png": _png}


def print_pad(pad: PadSpec, suffix: str, *, page: str = "a4", dpi: int = 300) -> PadPrint:
    """Return `pad` in the format of `suffix` (.pdf .svg .png) for paper of the size `page` (a4 a3 letter).

    What is larger than the page is spread over several in a PDF; SVG and PNG have no pages and grow instead. `dpi` is
    the PNG's resolution. Same arguments, same bytes. Raises UsageError for an unknown format or page, a resolution
    out of DPI_RANGE, and for what would need more pages or pixels than anybody prints.
    """
    if suffix not in FORMATS:
        raise UsageError(f"no printing format '{suffix}'", hint=f"known: {', '.join(FORMATS)}")
    if page not in PAGES:
        raise UsageError(f"no page size '{page}'", hint=f"known: {', '.join(PAGES)}")
    if not DPI_RANGE[0] <= dpi <= DPI_RANGE[1]:
        raise UsageError(f"{dpi} dots per inch", hint=f"it goes from {DPI_RANGE[0]} to {DPI_RANGE[1]}")
    layout = lay_out(pad, PAGES[page], tiled=suffix == ".pdf")
    first = layout.sheets[0]
    data = FORMATS[suffix](layout, dpi)
    return PadPrint(data, first.width_mm, first.height_mm, layout.rows, layout.columns)
