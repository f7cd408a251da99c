"""The report of a calibration as one picture: residuals, coverage, and the error over the picture."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from landtool.calibrate.calibration import Calibration, sigma_map_px
from landtool.calibrate.choose import CELLS
from landtool.geometry import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Rectangle

_WIDTH_IN, _DPI = 14.0, 100
_BLUE, _ORANGE, _DARK = "#0072b2", "#d55e00", "#222222"
_MAP = 48  # columns of the map of uncertainty


def draw_report(calibration: Calibration, title: str) -> bytes:
    """Return the report as a PNG, 1400 px wide."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    camera = calibration.camera
    shape = camera.height / camera.width
    height = 2.2 + 0.88 * _WIDTH_IN * min(max(shape, 0.5), 1.2)
    figure = Figure(figsize=(_WIDTH_IN, height), dpi=_DPI, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(
        f"{title}: {calibration.verdict}, rms {calibration.solution.rms_px:.3f} px, {len(calibration.views)} views",
        fontsize=14,
        parse_math=False,
    )
    panels = figure.subplots(2, 2)
    _draw_residuals(panels[0, 0], calibration)
    _draw_coverage(panels[0, 1], calibration)
    _draw_arrows(panels[1, 0], calibration)
    _draw_uncertainty(panels[1, 1], calibration)
    png = BytesIO()
    figure.savefig(png, format="png", dpi=_DPI, metadata={"Software": None})
    return png.getvalue()


def _draw_residuals(axes: Axes, calibration: Calibration) -> None:
    """Scatter what is left between corners and model; those that take no part are crosses."""
    residuals = np.concatenate(calibration.solution.residuals_px)
    used = np.concatenate(calibration.solution.weights) > 0
    reach = 1.15 * float(np.quantile(np.abs(residuals[used]), 0.998))
    shown = residuals.clip(-reach, reach)
    axes.plot(
        *shown[used].T, ".", color=_BLUE, markersize=3, alpha=0.35, rasterized=True, label=f"{used.sum()} corners"
    )
    if (~used).any():
        axes.plot(*shown[~used].T, "x", color=_ORANGE, markersize=5, label=f"{(~used).sum()} refused")
    axes.axhline(0, color=_DARK, linewidth=0.5)
    axes.axvline(0, color=_DARK, linewidth=0.5)
    axes.set(xlim=(-reach, reach), ylim=(reach, -reach), xlabel="px", ylabel="px", aspect="equal")
    axes.set_title("Residuals: measured minus modelled")
    axes.legend(loc="upper right")


def _frame(axes: Axes, calibration: Calibration) -> None:
    width, height = calibration.camera.width, calibration.camera.height
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal")


def _draw_coverage(axes: Axes, calibration: Calibration) -> None:
    """Corners of all views over the picture, cells without any marked."""
    width, height = calibration.camera.width, calibration.camera.height
    columns, rows = CELLS
    _frame(axes, calibration)
    for row, column in np.argwhere(calibration.cells == 0):
        corner = column * width / columns - 0.5, row * height / rows - 0.5
        axes.add_patch(_cell(corner, width / columns, height / rows))
    for named in calibration.views:
        axes.plot(*named.view.pixels.T, ".", markersize=2.5, alpha=0.6)
    axes.set_title(f"Coverage {100 * calibration.covered:.0f} %: corners, a colour a view; hatched cells have none")


def _cell(corner: tuple[float, float], width: float, height: float) -> Rectangle:
    from matplotlib.patches import Rectangle

    return Rectangle(corner, width, height, facecolor="#f3ddd0", edgecolor=_ORANGE, hatch="//", linewidth=0)


def _draw_arrows(axes: Axes, calibration: Calibration) -> None:
    """The mean residual about each place: what the lens model leaves unexplained."""
    pixels = np.concatenate([named.view.pixels for named in calibration.views])
    residuals = np.concatenate(calibration.solution.residuals_px)
    weights = np.concatenate(calibration.solution.weights)
    camera = calibration.camera
    columns, rows = 2 * CELLS[0], 2 * CELLS[1]
    places, means = _means(pixels, residuals, weights, (camera.width, camera.height), (columns, rows))
    _frame(axes, calibration)
    longest = float(np.quantile(np.linalg.norm(means, axis=1), 0.95)) if len(means) else 1.0
    scale = longest / (camera.width / columns)
    arrows = axes.quiver(
        *places.T, *means.T, angles="xy", scale_units="xy", scale=max(scale, 1e-9), color=_BLUE, width=0.003
    )
    axes.quiverkey(arrows, 0.88, 1.03, longest, f"{longest:.2g} px", labelpos="E")
    axes.set_title("Mean residual by place", loc="left")


def _means(
    pixels: Array, values: Array, weights: Array, size: tuple[int, int], cells: tuple[int, int]
) -> tuple[Array, Array]:
    """Return the middles (n, 2) of cells with three corners and more, and the weighted means (n, 2) in them."""
    place = ((pixels + 0.5) / size * cells).astype(int).clip(0, np.array(cells) - 1)
    index = place[:, 1] * cells[0] + place[:, 0]
    count = cells[0] * cells[1]
    enough = np.bincount(index[weights > 0], minlength=count) >= 3
    total = np.bincount(index, weights, count)
    sums = np.column_stack([np.bincount(index, weights * values[:, i], count) for i in (0, 1)])
    middles = np.column_stack([np.arange(count) % cells[0] + 0.5, np.arange(count) // cells[0] + 0.5])
    return (middles[enough] / cells * size) - 0.5, sums[enough] / total[enough, None]


def _draw_uncertainty(axes: Axes, calibration: Calibration) -> None:
    """How far off a ray may be seen, by the parameters' covariance."""
    camera = calibration.camera
    rows = max(2, round(_MAP * camera.height / camera.width))
    x, y = np.meshgrid(np.linspace(0, camera.width - 1, _MAP), np.linspace(0, camera.height - 1, rows))
    sigma = sigma_map_px(calibration.solution, np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
    known = np.isfinite(sigma)
    # the number that the text gives for the corners; a fisheye's circle may be worse beyond
    top = calibration.edge_sigma_px if np.isfinite(calibration.edge_sigma_px) else 1.0
    shown = axes.imshow(
        np.where(known, sigma, top),
        extent=(-0.5, camera.width - 0.5, camera.height - 0.5, -0.5),
        vmin=0.0,
        vmax=max(top, 1e-6),
        cmap="viridis",
        interpolation="bilinear",
    )
    beyond = bool((sigma[known] > 1.001 * top).any())
    bar = axes.figure.colorbar(shown, ax=axes, label="px", shrink=0.8, extend="max" if beyond else "neither")
    bar.set_ticks([0.0, top / 2.0, top], labels=["0", f"{top / 2.0:.3f}", f"{top:.2f}"])
    axes.set_title("Standard deviation of where a ray is seen")
