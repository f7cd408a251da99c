"""What an evaluation found out, as lines people read: the main numbers, several networks side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from landtool.evaluate.metric import Metric


@dataclass(frozen=True)
class Headline:
    """A number worth a line of its own: its key, what it is called, and its unit."""

    key: str
    text: str
    unit: str = ""


# In the order of the way a landing goes; everything else is in metrics.csv
HEADLINES = (
    Headline("detection.map50", "boxes: average precision at IoU 0.5"),
    Headline("detection.map50_95", "boxes: at IoU 0.5 to 0.95"),
    Headline("detection.recall", "boxes: targets found"),
    Headline("detection.false_alarms_per_frame", "boxes: false alarms a frame"),
    Headline("tags.read_share", "tags: legible ones read"),
    Headline("tags.corner_px_median", "tags: corners off", "px"),
    Headline("pose.pose_share", "poses: frames with one in six degrees of freedom"),
    Headline("pose.place_percent_median", "poses: place off, of the distance", "%"),
    Headline("pose.normal_deg_median", "poses: normal off", "deg"),
    Headline("pose.flips_per_1000", "poses: flips of 1000"),
    Headline("pose.nees_place", "poses: squared error over its covariance, 1 is right"),
    Headline("still_pose.place_percent_median", "single pictures: place off, of the distance", "%"),
    Headline("still_pose.normal_deg_median", "single pictures: normal off", "deg"),
    Headline("track.place_rmse_m", "track: place off", "m"),
    Headline("track.velocity_rmse_mps", "track: velocity off", "m/s"),
    Headline("track.nees", "track: squared error over its covariance, 1 is right"),
    Headline("track.lag_s", "track: lags behind", "s"),
    Headline("track.longest_gap_s", "track: longest gap", "s"),
    Headline("track.identity_switches", "track: changes of identity"),
    Headline("track.prediction_0.5_s_rmse_m", "prediction 0.5 s ahead: off", "m"),
    Headline("track.held_0.5_s_rmse_m", "holding the last place instead: off", "m"),
    Headline("dehaze.psnr_gain_db_mean", "dehazing: nearer to the clear picture by", "dB"),
    Headline("dehaze.ssim_gain", "dehazing: gain of SSIM"),
    Headline("dehaze.recall_gain", "dehazing: gain of targets found in fog"),
    Headline("time.rate_ppm", "clock: runs too fast by", "ppm"),
    Headline("speed.track_fps", "speed: landtool track", "frames/s"),
    Headline("speed.detect_ms", "speed: one look of the network", "ms"),
)

# What a stage is called where nothing of it could be told
_STAGES = {
    "detection": "boxes",
    "tags": "tags",
    "pose": "poses",
    "still_pose": "single pictures",
    "track": "track and prediction",
    "dehaze": "dehazing",
    "time": "clock",
    "speed": "speed",
}


def headline_rows(metrics: Sequence[Metric]) -> tuple[list[str], list[tuple[str, list[str]]]]:
    """Return the networks' names, and of the stages that were scored each main number: its text, and a cell a network.

    Without a network there is one name, the empty one. A stage of which nothing could be told has one row.
    """
    models = list(dict.fromkeys(m.model for m in metrics if m.model)) or [""]
    whole = {(m.key, m.model): m for m in metrics if not m.slice}
    scored = {m.stage for m in metrics}
    rows: dict[str, list[str]] = {}
    for headline in HEADLINES:
        stage = headline.key.partition(".")[0]
        found = [whole.get((headline.key, model)) or whole.get((headline.key, "")) for model in models]
        if stage not in scored or all(m is None for m in found):
            continue
        if not any(m.value is not None for m in metrics if m.stage == stage):
            rows[_STAGES[stage]] = ["undefined, 0 of 0"] * len(models)
        else:
            rows[headline.text] = [_said(m, headline.unit) for m in found]
    return models, list(rows.items())


def metric_lines(metrics: Sequence[Metric]) -> list[str]:
    """Return the main numbers of the stages that were scored, a line each; of several networks a column each."""
    models, rows = headline_rows(metrics)
    if not rows:
        return ["nothing was scored"]
    wide = max(len(text) for text, _ in rows)
    columns = [max(len(model), *(len(cells[i]) for _, cells in rows)) for i, model in enumerate(models)]
    head = [("", models)] if len(models) > 1 else []
    return [
        "  ".join([text.ljust(wide), *(cell.ljust(w) for cell, w in zip(cells, columns, strict=True))]).rstrip()
        for text, cells in head + rows
    ]


def _said(metric: Metric | None, unit: str) -> str:
    """Return `0.95 m (0.93 to 0.97), 120 of 126`; a unit stands behind the value."""
    if metric is None:
        return "not scored"
    if not unit or metric.value is None:
        return metric.said
    value, rest = metric.said[: len(f"{metric.value:.4g}")], metric.said[len(f"{metric.value:.4g}") :]
    return f"{value} {unit}{rest}"
