"""The printed target measured with a ruler of pixels: true scale, upright, not mirrored, whole when joined."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from io import BytesIO

import cv2
import numpy as np
import pypdfium2
import pytest
from apriltag import apriltag
from numpy.typing import NDArray
from PIL import Image

from landtool.errors import UsageError
from landtool.families import tag_family
from landtool.geometry import Array
from landtool.pad import PadSpec, PadTag
from landtool.print_pad import PRINT_DIAMETER_M, print_pad
from landtool.print_pad.layout import OVERLAP_MM, PAGES, lay_out
from landtool.print_pad.sheet import Area, Point, outlines, place

Picture = NDArray[np.uint8]
A4_PAD = PadSpec(diameter_m=PRINT_DIAMETER_M)
PX_PER_MM = 8.0


def pdf_pages(data: bytes, px_per_mm: float = PX_PER_MM) -> list[Picture]:
    """Render every page (H, W, 3) RGB."""
    document = pypdfium2.PdfDocument(data)
    scale = px_per_mm * 25.4 / 72.0
    return [np.asarray(page.render(scale=scale).to_numpy())[:, :, ::-1].copy() for page in document]


def pdf_text(data: bytes, page: int = 0) -> str:
    return str(pypdfium2.PdfDocument(data)[page].get_textpage().get_text_bounded())


def png_picture(data: bytes) -> tuple[Picture, float]:
    """The picture and its own statement of pixels a millimetre."""
    image = Image.open(BytesIO(data))
    dpi = image.info["dpi"]
    assert dpi[0] == dpi[1]
    return np.asarray(image), float(dpi[0]) / 25.4


def ring_extent_px(picture: Picture) -> tuple[float, float, float, float]:
    """Left, top, right, bottom edge of everything red; an edge pixel counts by how red it is."""
    red = np.clip((picture[:, :, 0].astype(float) - picture[:, :, 1]) / (215 - 25), 0, 1)
    across, down = red.max(axis=0), red.max(axis=1)
    columns, rows = np.flatnonzero(across > 0.05), np.flatnonzero(down > 0.05)
    left, right = columns[0] + 1 - across[columns[0]], columns[-1] + across[columns[-1]]
    return left, rows[0] + 1 - down[rows[0]], right, rows[-1] + down[rows[-1]]


def tags_in(picture: Picture, family: str = "tag36h11") -> list[tuple[int, Array]]:
    """Id and corners (4, 2) of every tag the AprilTag library reads."""
    gray = np.ascontiguousarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY))
    return [(tag["id"], np.array(tag["lb-rb-rt-lt"])) for tag in apriltag(family).detect(gray)]


def sides(corners: Array) -> Array:
    lengths: Array = np.hypot(*(corners - np.roll(corners, 1, axis=0)).T)
    return lengths


def turned(x: float, y: float, u: Array, v: Array, angle_deg: float) -> Array:
    """Pixels (2, ...) as seen from (x, y) along axes turned to the left on the print."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.stack([(u - x) * c - (v - y) * s, (u - x) * s + (v - y) * c])


def module_centres(pad: PadSpec, tag: PadTag, centre: Point, per_m: float) -> Array:
    """Where the modules of a tag (n, n, 2) stand on a print of `per_m` units a metre: first row at its top."""
    family = tag_family(tag.family)
    n = family.total_modules
    step = pad.tag_size_m(tag) * per_m / family.border_modules
    column, row = np.meshgrid(np.arange(n), np.arange(n))
    return np.stack([centre[0] + (column - (n - 1) / 2) * step, centre[1] + (row - (n - 1) / 2) * step], axis=-1)


def assert_pad_v1(picture: Picture, px_per_mm: float, diameter_mm: float) -> None:
    """Ring and tag have their size to 0.1 mm, and the tag stands upright in the middle, as in pad.md."""
    left, top, right, bottom = ring_extent_px(picture)
    assert (right - left) / px_per_mm == pytest.approx(diameter_mm, abs=0.1)
    assert (bottom - top) / px_per_mm == pytest.approx(diameter_mm, abs=0.1)
    ((tag_id, corners),) = tags_in(picture)
    assert tag_id == 5
    np.testing.assert_allclose(sides(corners) / px_per_mm, 0.16 * diameter_mm, atol=0.1)
    centre = ((left + right) / 2, (top + bottom) / 2)
    np.testing.assert_allclose(corners.mean(axis=0) / px_per_mm, np.array(centre) / px_per_mm, atol=0.1)
    at = module_centres(PadSpec(), PadTag(), centre, diameter_mm * px_per_mm).astype(int)
    np.testing.assert_array_equal(picture[at[..., 1], at[..., 0], 1] > 128, tag_family("tag36h11").modules(5))


@pytest.mark.parametrize("page", list(PAGES))
def test_pdf_is_true_to_scale(page: str) -> None:
    made = print_pad(A4_PAD, ".pdf", page=page)
    assert (made.rows, made.columns) == (1, 1)
    width, height = pypdfium2.PdfDocument(made.data)[0].get_size()
    np.testing.assert_allclose(np.array([width, height]) * 25.4 / 72, PAGES[page], atol=1e-3)
    (picture,) = pdf_pages(made.data)
    assert_pad_v1(picture, PX_PER_MM, 180.0)


@pytest.mark.parametrize("dpi", [150, 203])
def test_png_is_true_to_the_scale_it_states(dpi: int) -> None:
    picture, px_per_mm = png_picture(print_pad(A4_PAD, ".png", dpi=dpi).data)
    assert px_per_mm == pytest.approx(dpi / 25.4, rel=1e-4)
    np.testing.assert_allclose(picture.shape[:2], np.array([297, 210]) * px_per_mm, atol=0.5)
    assert_pad_v1(picture, px_per_mm, 180.0)


def test_png_edge_is_averaged_in_light() -> None:
    # at 5 px/mm the H's left stem begins at 525 - 0.26 * 175 * 5 = 297.5 px: in the middle of pixel 297
    picture, px_per_mm = png_picture(print_pad(A4_PAD.scaled(0.175), ".png", dpi=127).data)
    assert px_per_mm == pytest.approx(5.0)
    middle = picture[450, 296:300, 1]
    # half of white's light and half of sRGB 20's, encoded: 188 and a little
    np.testing.assert_allclose(middle, [255, 188, 20, 20], atol=2)


def svg_loops(element: ET.Element) -> list[Array]:
    parts = element.attrib["d"].split("Z")
    return [np.array(re.findall(r"[-\d.]+", part), float).reshape(-1, 2) for part in parts if part.strip()]


def winding(loops: list[Array], points: Array) -> NDArray[np.int64]:
    """How often the loops go around each of the points (N, 2)."""
    count = np.zeros(len(points), np.int64)
    for loop in loops:
        for (ax, ay), (bx, by) in zip(loop, np.roll(loop, -1, axis=0), strict=True):
            left = (bx - ax) * (points[:, 1] - ay) - (points[:, 0] - ax) * (by - ay) > 0
            count += (ay <= points[:, 1]) & (points[:, 1] < by) & left
            count -= (by <= points[:, 1]) & (points[:, 1] < ay) & ~left
    return count


def test_svg_is_in_millimetres_and_upright() -> None:
    root = ET.fromstring(print_pad(A4_PAD, ".svg").data)
    assert (root.attrib["width"], root.attrib["height"]) == ("210mm", "297mm")
    assert root.attrib["viewBox"] == "0 0 210 297"
    circles = [element for element in root if element.tag.endswith("circle")]
    assert [float(circle.attrib["r"]) for circle in circles] == [90.0, 75.6]
    centre = (float(circles[0].attrib["cx"]), float(circles[0].attrib["cy"]))
    at = module_centres(A4_PAD, PadTag(), centre, 1000.0)
    white = np.ones(at.shape[:2], bool)
    for path in (element for element in root if element.tag.endswith("path")):
        inside = winding(svg_loops(path), at.reshape(-1, 2)).reshape(white.shape) != 0
        white[inside] = path.attrib["fill"] == "#ffffff"
    np.testing.assert_array_equal(white, tag_family("tag36h11").modules(5))


def test_every_tag_stands_where_the_pad_frame_says() -> None:
    # x to the top of the print, y to its left
    pad = PadSpec(diameter_m=0.15, letter=None, tags=(PadTag(), PadTag(id=6, x=0.25), PadTag(id=7, y=0.25)))
    (picture,) = pdf_pages(print_pad(pad, ".pdf").data)
    found = {tag: corners.mean(axis=0) / PX_PER_MM for tag, corners in tags_in(picture)}
    np.testing.assert_allclose(found[6] - found[5], [0.0, -0.25 * 150], atol=0.1)
    np.testing.assert_allclose(found[7] - found[5], [-0.25 * 150, 0.0], atol=0.1)


@pytest.mark.parametrize("yaw_deg", [0.0, 30.0])
def test_no_hairline_between_modules(yaw_deg: float) -> None:
    # turned, because viewers lay upright rectangles on whole pixels, which hides the seams
    tag = PadTag(size=0.6, yaw_deg=yaw_deg)
    pad = PadSpec(diameter_m=0.1, letter=None, quiet_zone=None, tags=(tag,))
    (picture,) = pdf_pages(print_pad(pad, ".pdf").data, px_per_mm=4.37)
    left, top, right, bottom = ring_extent_px(picture)
    family = tag_family(tag.family)
    white, step = family.modules(tag.id), pad.tag_size_m(tag) / family.border_modules
    for color, wanted in ((False, 0), (True, 255)):
        # the middles of the edges between a module and the one below it
        row, column = np.nonzero((white[:-1] == color) & (white[1:] == color))
        in_tag = np.column_stack([column - 4.5, 4.0 - row, np.zeros(len(row))]) * step
        x, y, _ = pad.pad_T_tag(tag).apply(in_tag).T * 1000 * 4.37
        at = np.column_stack([(left + right) / 2 - y, (top + bottom) / 2 - x]).astype(int)
        assert len(at) > 10
        np.testing.assert_array_equal(picture[at[:, 1], at[:, 0]], wanted)


def test_no_dark_rim_around_a_tag_s_white_border() -> None:
    pad = PadSpec(diameter_m=0.1, letter=None, quiet_zone=None, tags=(PadTag(size=0.6, yaw_deg=30.0),))
    (picture,) = pdf_pages(print_pad(pad, ".pdf").data, px_per_mm=4.37)
    left, top, right, bottom = ring_extent_px(picture)
    v, u = np.mgrid[: picture.shape[0], : picture.shape[1]]
    far = np.maximum(*np.abs(turned((left + right) / 2, (top + bottom) / 2, u, v, 30.0))) / 4.37
    # black ends 30 mm from the middle, white 37.5 mm, and the ring is farther than 42 mm
    around = (far > 31) & (np.hypot(u - (left + right) / 2, v - (top + bottom) / 2) < 41.5 * 4.37)
    assert picture[around].min() == 255


@pytest.mark.parametrize("yaw_deg", [0.0, 30.0, -77.7])
@pytest.mark.parametrize("family", ["tag36h11", "tagStandard41h12"])
def test_outlines_fill_the_same_area_without_inner_edges(family: str, yaw_deg: float) -> None:
    tag = PadTag(family, 9, 0.3, 0.01, -0.02, yaw_deg)
    pad = PadSpec(diameter_m=0.2345678, ring=None, board=None, letter=None, quiet_zone=None, tags=(tag,))
    _, black = place(pad.shapes(), (0.0, 0.0), 1000.0)
    assert isinstance(black, Area)
    loops = outlines(black)
    want = sum(cv2.contourArea(polygon.astype(np.float32)) for polygon in black.polygons)
    got = sum(cv2.contourArea(loop.astype(np.float32), oriented=True) for loop in loops)
    assert abs(got) == pytest.approx(want, rel=1e-4)
    # the length of all outlines is that of the borders between black and white modules
    modules = np.pad(tag_family(family).modules(9), 1, constant_values=True)
    borders = np.count_nonzero(np.diff(modules, axis=0)) + np.count_nonzero(np.diff(modules, axis=1))
    step = pad.tag_size_m(tag) * 1000 / tag_family(family).border_modules
    assert sum(sides(loop).sum() for loop in loops) == pytest.approx(borders * step, rel=1e-3)


def test_a_large_target_is_whole_again_when_its_pages_are_joined() -> None:
    pad = PadSpec(diameter_m=0.4)
    made = print_pad(pad, ".pdf")
    layout = lay_out(pad, PAGES["a4"], tiled=True)
    assert (made.rows, made.columns) == (layout.rows, layout.columns) == (2, 3)
    scale = 5.0
    joined = np.zeros((round(440 * scale), round(440 * scale), 3), np.uint8)
    for i, (picture, sheet) in enumerate(zip(pdf_pages(made.data, scale), layout.sheets, strict=True)):
        row, column = divmod(i, made.columns)
        left, top, width, height = sheet.window
        assert left >= 5  # a printer's white border
        assert top + height <= PAGES["a4"][1] - 30  # the footer
        x, y = round(column * (width - OVERLAP_MM) * scale), round(row * (height - OVERLAP_MM) * scale)
        part = picture[round(top * scale) :, round(left * scale) :][: round(height * scale), : round(width * scale)]
        place_ = joined[y : y + part.shape[0], x : x + part.shape[1]]
        place_[:] = part[: place_.shape[0], : place_.shape[1]]
    left, top, right, bottom = ring_extent_px(joined)
    # pages join at whole pixels of 0.2 mm
    assert (right - left) / scale == pytest.approx(400.0, abs=0.5)
    assert (bottom - top) / scale == pytest.approx(400.0, abs=0.5)
    ((tag_id, corners),) = tags_in(joined)
    assert tag_id == 5
    np.testing.assert_allclose(sides(corners) / scale, 64.0, atol=0.5)


def test_neighbouring_pages_repeat_the_overlap() -> None:
    made = print_pad(PadSpec(diameter_m=0.4), ".pdf")
    first, second = pdf_pages(made.data, 4.0)[:2]
    left, top, width, height = lay_out(PadSpec(diameter_m=0.4), PAGES["a4"], tiled=True).sheets[0].window
    rows = slice(round(top * 4), round((top + height) * 4))
    end, overlap = round((left + width) * 4), round(OVERLAP_MM * 4)
    a, b = first[rows, end - overlap : end], second[rows, round(left * 4) :][:, :overlap]
    # the ring passes here; soft edges may fall differently on the pixels
    assert np.ptp(a[2:-2, 2:-2, 1]) > 200
    assert np.mean(np.abs(a[2:-2, 2:-2].astype(int) - b[2:-2, 2:-2]) > 60) < 0.01


def test_each_page_says_what_it_is() -> None:
    single = pdf_text(print_pad(A4_PAD, ".pdf").data)
    for words in ("pad v1", "D = 180 mm", "tag36h11 id 5: 28.8 mm", "100 %", "no scaling", "100 mm"):
        assert words in single
    tiled = print_pad(PadSpec(diameter_m=0.4), ".pdf").data
    assert "Row 2 of 2, column 1 of 3" in pdf_text(tiled, 3)
    assert "D = 400 mm" in pdf_text(tiled, 3)


@pytest.mark.parametrize("suffix", [".pdf", ".png"])
def test_the_ruler_measures_100_mm(suffix: str) -> None:
    data = print_pad(A4_PAD, suffix, dpi=254).data
    picture, px_per_mm = png_picture(data) if suffix == ".png" else (pdf_pages(data)[0], PX_PER_MM)
    # a row through all the ticks, where nothing else is black; its base line is 30 - 6.8 mm above the foot
    row = picture[round((297 - 23.2 - 1.0) * px_per_mm), :, 1]
    dark = np.flatnonzero(row < 200)
    ticks = np.split(dark, np.flatnonzero(np.diff(dark) > 1) + 1)
    assert len(ticks) == 101
    assert (ticks[-1].mean() - ticks[0].mean()) / px_per_mm == pytest.approx(100.0, abs=0.1)


def test_the_margin_holds_no_second_tag() -> None:
    # page 3 shows no tag of the target, but its small overview of all pages does
    picture = pdf_pages(print_pad(PadSpec(diameter_m=0.4), ".pdf").data, 20.0)[0]
    assert tags_in(picture) == []


def test_svg_and_png_grow_instead_of_being_tiled() -> None:
    pad = PadSpec(diameter_m=0.4)
    made = print_pad(pad, ".png", dpi=72)
    assert (made.rows, made.columns) == (1, 1)
    assert made.width_mm > 440
    picture, px_per_mm = png_picture(made.data)
    assert_pad_v1(picture, px_per_mm, 400.0)
    assert float(ET.fromstring(print_pad(pad, ".svg").data).attrib["width"].removesuffix("mm")) == pytest.approx(
        made.width_mm
    )


@pytest.mark.parametrize("suffix", [".pdf", ".svg", ".png"])
def test_same_pad_same_bytes(suffix: str) -> None:
    assert print_pad(A4_PAD, suffix, dpi=72).data == print_pad(A4_PAD, suffix, dpi=72).data


@pytest.mark.parametrize("suffix", [".pdf", ".svg", ".png"])
@pytest.mark.parametrize(
    "pad",
    [
        PadSpec(name="<H & Ünï☃\x07>", diameter_m=0.1),
        PadSpec(diameter_m=0.1, board=None, ring=None, letter=None, quiet_zone=None),
        PadSpec(diameter_m=0.01, tags=()),
    ],
)
def test_unusual_pads_print(pad: PadSpec, suffix: str) -> None:
    data = print_pad(pad, suffix, dpi=72).data
    if suffix == ".svg":
        ET.fromstring(data)
    elif suffix == ".png":
        assert png_picture(data)[0].min() < 100
    else:
        assert pdf_pages(data, 2.0)[0].min() < 100


def test_pads_without_a_ring_are_tiled_too() -> None:
    pad = PadSpec(diameter_m=1.5, board=None, ring=None, letter=None, quiet_zone=None)
    pages = pdf_pages(print_pad(pad, ".pdf").data, 2.0)
    assert len(pages) == 4


@pytest.mark.parametrize(
    ("pad", "suffix", "options", "said"),
    [
        (A4_PAD, ".jpg", {}, "known: .pdf, .svg, .png"),
        (A4_PAD, ".pdf", {"page": "a5"}, "known: a4, a3, letter"),
        (A4_PAD, ".png", {"dpi": 20}, "from 36 to 2400"),
        (PadSpec(diameter_m=20.0), ".pdf", {}, "at most 1000"),
        (PadSpec(diameter_m=20.0), ".png", {}, "write an .svg"),
        (PadSpec(diameter_m=2.0), ".png", {}, "lower --dpi to [12]"),
    ],
)
def test_a_request_nobody_can_print_is_refused(
    pad: PadSpec, suffix: str, options: dict[str, object], said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        print_pad(pad, suffix, **options)  # type: ignore[arg-type]
