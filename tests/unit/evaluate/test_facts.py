"""The parts of the data: every known value is in exactly one."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from landtool.evaluate.facts import BOUNDS, parts


@pytest.mark.parametrize("fact", BOUNDS)
def test_every_value_is_in_one_part_and_an_unknown_one_in_none(fact: str) -> None:
    bounds = BOUNDS[fact]
    ends = [bound for bound in bounds if math.isfinite(bound)][: None if math.isinf(bounds[-1]) else -1]
    values = [*ends, *(end * 1.01 for end in ends), None]
    found = list(parts(fact, values))
    counts = np.sum([inside for _, inside in found], axis=0)
    assert counts.tolist() == [1] * (len(values) - 1) + [0]
    assert len({name for name, _ in found}) == len(found)


@pytest.mark.parametrize("fact", BOUNDS)
def test_bounds_rise_and_names_have_no_blanks(fact: str) -> None:
    assert all(low < high for low, high in pairwise(BOUNDS[fact]))
    middle = [low + 1.0 if math.isinf(high) else (low + high) / 2 for low, high in pairwise(BOUNDS[fact])]
    names = [name for name, _ in parts(fact, middle)]
    assert len(names) == len(middle)
    assert not any(" " in name or "," in name for name in names)


def test_names_say_their_bounds() -> None:
    assert [name for name, _ in parts("distance_m", [3.0, 30.0])] == ["distance_m=2-4", "distance_m=25-more"]
    assert [name for name, _ in parts("fog_per_m", [0.0, 0.02])] == ["fog_per_m=clear", "fog_per_m=0-0.05"]


def test_parts_without_a_value_are_left_out() -> None:
    assert list(parts("size_px", [None, None])) == []
    assert list(parts("size_px", [])) == []
    assert [name for name, _ in parts("size_px", [13.999, 14.0])] == ["size_px=0-14", "size_px=14-20"]


def test_an_unknown_fact() -> None:
    with pytest.raises(KeyError):
        next(parts("colour", [1.0]))
