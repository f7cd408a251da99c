"""One figure of what was drawn how often, and of what goes with the pad's size."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.synth.fog import KOSCHMIEDER
from landtool.synth.preview.correlation import LIMIT, Correlation, correlations
from landtool.synth.preview.facts import Facts

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BLUE, _RED, _GREY = "#0072b2", "#d55e00", "#999999"
_DPI = 80
_BINS = 30


def truth_correlations(facts: Facts) -> list[Correlation]:
    """Return how the logarithm of the pad's size goes with everything it should be independent of.

    The place is that of the pad's own centre: the centre of a box that is cut at the border is nearer to the middle the
    larger the box is, however it was placed.
    """
    number = facts.numbers
    place = facts.shares(facts.centre_px)
    numbers = {
        "place x": place[:, 0],
        "place y": place[:, 1],
        "place from centre": np.hypot(*(place - 0.5).T),
        "light, log": _log(number["light"]),
        "tilt": number["tilt_rad"],
        "yaw, sin": np.sin(number["yaw_rad"]),
        "yaw, cos": np.cos(number["yaw_rad"]),
        "fog beta, log": _log(number["beta_per_m"]),
        "has fog": (number["beta_per_m"] > 0.0).astype(np.float64),
        "blur": facts.blur_px,
        "shadow": number["shadow"],
        "signs": np.array([len(signs) for signs in facts.signs], dtype=np.float64),
    }
    seen = np.where(facts.present, number["size_px"], np.nan)
    return correlations(seen, numbers, {"ground": facts.ground, "carrier": facts.carrier})


def draw_statistics(facts: Facts, brightness: Array) -> bytes:
    """Return a PNG of histograms and the correlations. brightness: (N,) mean grey level of every picture."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(24, 14))
    FigureCanvasAgg(figure)  # or saving would ask for the window system
    with_pad = int(facts.present.sum())
    figure.suptitle(f"{len(facts)} pictures, {with_pad} with a pad ({100 * with_pad / len(facts):.1f} %)")
    # places by hand: letting matplotlib find them takes longer than drawing
    histograms = {"left": 0.05, "right": 0.77, "top": 0.93, "bottom": 0.03, "hspace": 0.24, "wspace": 0.3}
    _histograms(figure.subplots(3, 4, height_ratios=(1.0, 1.0, 1.5), gridspec_kw=histograms), facts, brightness)
    _bars_of(figure.add_axes((0.88, 0.03, 0.11, 0.9)), truth_correlations(facts))
    data = BytesIO()
    # no name of the software, whose version would change the bytes
    figure.savefig(data, format="png", dpi=_DPI, metadata={"Software": None})
    return data.getvalue()


def _histograms(axes: NDArray[np.object_], facts: Facts, brightness: Array) -> None:
    """Fill axes (3, 4)."""
    number, beta = facts.numbers, facts.numbers["beta_per_m"]
    _histogram(axes[0, 0], number["size_px"], "ring's diameter, px", log=True)
    _histogram(axes[0, 1], number["height_m"], "height, m", log=True)
    _histogram(axes[0, 2], np.degrees(number["tilt_rad"]), "tilt of the camera, degrees")
    _histogram(axes[0, 3], np.degrees(number["yaw_rad"]), "yaw of the pad, degrees")
    _places(axes[1, 0], facts)
    _histogram(axes[1, 1], number["visible_fraction"], "visible share of the pad")
    foggy = beta > 0.0
    sight = np.divide(KOSCHMIEDER, beta, out=np.full(len(beta), np.nan), where=foggy)
    _histogram(axes[1, 2], sight, f"visibility in fog, m ({100 * foggy.mean():.0f} % have fog)", log=True)
    _histogram(axes[1, 3], brightness, "mean grey level of the picture")
    _counts(axes[2, 0], facts.ground, "grounds")
    _counts(axes[2, 1], (c for c, p in zip(facts.carrier, facts.present, strict=True) if p), "the pad lies on")
    _counts(axes[2, 2], (sign for signs in facts.signs for sign in signs), "similar signs")
    _counts(axes[2, 3], _contents(facts), "what pictures hold")


def _contents(facts: Facts) -> list[str]:
    names = {(True, True): "pad, signs", (True, False): "pad", (False, True): "signs", (False, False): "neither"}
    return [names[bool(p), bool(s)] for p, s in zip(facts.present, facts.signs, strict=True)]


def _histogram(axes: Axes, values: Array, title: str, *, log: bool = False) -> None:
    known = values[np.isfinite(values) & ((values > 0.0) | (not log))]
    if len(known) and log:
        low, high = known.min(), known.max()
        edges = np.geomspace(low, max(high, low * 1.01), _BINS + 1)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter("")
    else:
        edges = np.histogram_bin_edges(known, _BINS)
    axes.hist(known, bins=edges.tolist(), color=_BLUE)
    if len(known):
        low, middle, high = np.percentile(known, [5, 50, 95])
        axes.axvline(middle, color=_RED, linewidth=1)
        title += f"\n5 %: {low:.3g}, median {middle:.3g}, 95 %: {high:.3g}"
    axes.set_title(title, fontsize=10)


def _places(axes: Axes, facts: Facts) -> None:
    """Draw where boxes have their centres; evenly filled but at the border, where pads are cut."""
    box = facts.box_px
    place = facts.shares((box[:, :2] + box[:, 2:]) / 2.0)[facts.present]
    counts, _, _ = np.histogram2d(place[:, 1], place[:, 0], bins=(9, 12), range=((0, 1), (0, 1)))
    axes.imshow(counts, cmap="viridis", vmin=0, extent=(0, 1, 1, 0), aspect=0.75)
    axes.set_title(f"centre of the box, share of the picture\n0 to {int(counts.max())} a cell", fontsize=10)


def _counts(axes: Axes, names: Iterable[str], title: str) -> None:
    counted = sorted(Counter(names).items(), key=lambda item: (item[1], item[0]))
    labels, counts = [name or "-" for name, _ in counted], [count for _, count in counted]
    axes.barh(labels, counts, color=_BLUE)
    axes.tick_params(axis="y", labelsize=8 if len(counted) < 20 else 6)
    axes.set_title(f"{title} ({len(counted)} kinds, {sum(counts)})", fontsize=10)


def _bars_of(axes: Axes, rows: Sequence[Correlation]) -> None:
    """Draw the coefficients as bars beside their numbers; red: farther from 0 than they may be."""
    values: NDArray[np.float64] = np.nan_to_num([row.coefficient for row in rows])
    colors = [_RED if abs(v) > LIMIT else _BLUE for v in values]
    axes.barh(range(len(rows)), values, color=colors)
    axes.set_yticks(range(len(rows)), [f"{row.name}  {number_text(row.coefficient)}" for row in rows], fontsize=9)
    axes.invert_yaxis()
    for edge in (-LIMIT, LIMIT):
        axes.axvline(edge, color=_GREY, linestyle="--", linewidth=1)
    chance = max((row.chance for row in rows), default=0.0)
    axes.axvspan(-chance, chance, color=_GREY, alpha=0.2)
    reach = max(2.0 * LIMIT, 1.05 * float(np.abs(values).max(initial=0.0)))
    axes.set_xlim(-reach, reach)
    axes.set_title("correlation with log of the size\ngrey: what chance alone gives", fontsize=10)


def number_text(coefficient: float) -> str:
    """Return a coefficient as text, a dash where there is none."""
    return f"{coefficient:+.3f}" if np.isfinite(coefficient) else "-"


def _log(values: Array) -> Array:
    """Return the logarithm of what is positive, NaN for the rest."""
    return np.log(values, out=np.full(len(values), np.nan), where=values > 0.0)
