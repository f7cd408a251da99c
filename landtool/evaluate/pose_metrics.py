"""What the errors of poses come to: medians, tails, shares, flips, and whether covariances are honest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from landtool.evaluate.bootstrap import Resamples
from landtool.evaluate.columns import Chosen, column, flags, over_parts
from landtool.evaluate.metric import Metric, Stage, metric
from landtool.evaluate.pose_errors import PoseError

PARTS = ("distance_m", "tilt_deg", "fog_per_m", "size_px", "visible")
_METHODS = ("tag", "target", "box")
_DOF = 3  # of a place, and of a rotation
# name, column, share of the errors below
_QUANTILES = (
    ("place_percent_median", "place_percent", 0.5),
    ("place_percent_p95", "place_percent", 0.95),
    ("across_percent_median", "across_percent", 0.5),
    ("along_percent_median", "along_percent", 0.5),
    ("place_m_median", "place_m", 0.5),
    ("normal_deg_median", "normal_deg", 0.5),
    ("normal_deg_p95", "normal_deg", 0.95),
    ("rotation_deg_median", "rotation_deg", 0.5),
)


def pose_metrics(errors: Sequence[PoseError], stage: Stage = "pose") -> list[Metric]:
    """Return the metrics of poses; stage: `pose` of clips, `still_pose` of single pictures.

    Errors are those of poses of six degrees of freedom. pose_share: of the pictures in which such a one is to be
    expected (`TruePad.measurable`). tag_share, target_share, box_share: of all poses. flips_per_1000: of the poses of
    frames in which a track is confirmed, of single pictures of all. nees_place, nees_rotation: mean normalised error
    squared over its degrees of freedom, 1 of honest covariances.
    """
    resamples = Resamples([error.unit for error in errors])
    distance_m = column(errors, "distance_m")
    columns = {name: column(errors, name) for name in ("place_m", "normal_deg", "rotation_deg")}
    for name in ("place", "along", "across"):
        columns[f"{name}_percent"] = 100.0 * column(errors, f"{name}_m") / distance_m
    nees = {name: column(errors, name) / _DOF for name in ("nees_place", "nees_rotation")}
    method = np.array([error.method for error in errors], object)
    whole, wanted = flags(errors, "whole"), flags(errors, "measurable")
    trusted = whole & np.array([error.confirmed is not False for error in errors], np.bool_)
    flipped = flags(errors, "flipped")

    def judge(chosen: Chosen, part: str) -> Iterator[Metric]:
        asked = chosen & wanted
        yield metric(stage, "pose_share", resamples.mean(whole[asked], asked), "higher", slice=part)
        posed, of = chosen & whole, int(chosen.sum())
        for name, source, share in _QUANTILES:
            estimate = resamples.quantile(columns[source][posed], share, posed)
            yield metric(stage, name, estimate, "lower", of=of, slice=part)
        sure = chosen & trusted
        flips = resamples.mean(flipped[sure], sure).scaled(1000.0)
        yield metric(stage, "flips_per_1000", flips, "lower", of=int(posed.sum()), slice=part)
        for name, values in nees.items():
            told = posed & np.isfinite(values)
            yield metric(stage, name, resamples.mean(values[told], told), "expected", of=of, expected=1.0, slice=part)
        any_pose = chosen & (method != None)  # noqa: E711 - by element
        for name in _METHODS:
            estimate = resamples.mean(method[any_pose] == name, any_pose)
            yield metric(stage, f"{name}_share", estimate, "neither", of=of, slice=part)

    return over_parts(judge, errors, PARTS)
