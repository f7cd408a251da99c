"""Where and how turned a print may be, to a few tenths of its radius, near a box that is good to a fourth of it.

Ellipses of several shapes and places are filled with the print as it looks on the mean of all turns, and compared with
the picture; the best of them are then compared with it in every turn. All are weighed by how much of the picture they
explain, not by the correlation alone: a small ellipse would always find a place where it is higher.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.geometry import Array
from landtool.pad import PadSpec
from landtool.target.print_model import Plane, print_of
from landtool.tone import Tone

Floats = NDArray[np.floating[Any]]

_STEP = 1.0 / 7.0  # of the grid, in half sides of the box
_REACH = 8  # of a template, steps
_SHIFT = 3  # of its place, steps
_SIZES = (0.7, 0.84, 1.0, 1.2, 1.44)  # of half sides, in the box's
_SLANTS = (-0.3, 0.0, 0.3)
_BLUR = 0.11  # standard deviation, radii
_RED_BLUR = 0.17
_RED_SHARE = 0.6  # of what redness tells, as it is noisy and smeared
_TELLS = 0.3  # what a pixel tells, as neighbours are alike
_OFF, _OFF_PX = 0.14, 0.87  # standard deviation of half of two edges' errors, half sides and pixels
_SLANT_SIGMA = 0.3
_SHAPES = 10  # are tried in every turn
_STARTS = 3
_RADII, _TURNS = 12, 48
_OTHER = 3.0  # how much worse another turn may be, to be taken rather than a neighbour of the best


@dataclass(frozen=True, eq=False)
class Start:
    """A guess: pixel (column, row) in the patch = axes (2, 2) @ (u, v) + centre (2,), (u, v) in radii on the print."""

    axes: Array
    centre: Array


@dataclass(frozen=True, eq=False)
class _Shapes:
    """Candidates for an ellipse's place: centres (N, 2), half sides (N, 2), slants (N,), and minus log prior (N,)."""

    centres: Array
    halves: Array
    slants: Array
    unlikely: Array


def find_starts(dark: Plane, red: Plane, box_px: Array, pad: PadSpec, tone: Tone) -> list[Start]:
    """Return the likeliest places of a print, best first, by a patch's darkness and redness (h, w) and a box in it."""
    shapes = _find_shapes(dark, red, box_px, pad, tone)
    starts = []
    for i, turn in _find_turns(dark, shapes, pad, tone):
        (a, b), slant = shapes.halves[i], float(shapes.slants[i])
        root = np.array([[a, 0.0], [slant * b, math.sqrt(1.0 - slant**2) * b]])
        c, s = math.cos(turn), math.sin(turn)
        starts.append(Start(root @ np.array([[c, -s], [s, c]]), shapes.centres[i]))
    return starts


def _find_shapes(dark: Plane, red: Plane, box_px: Array, pad: PadSpec, tone: Tone) -> _Shapes:
    centre, half = (box_px[:2] + box_px[2:]) / 2.0, (box_px[2:] - box_px[:2]) / 2.0
    step = half * _STEP
    both = np.asarray(cv2.merge([dark, red]), np.float32)
    if step.max() > 1.3:
        both = np.asarray(cv2.GaussianBlur(both, (0, 0), 0.45 * float(step.max())), np.float32)
    reach = _REACH + _SHIFT
    matrix = np.array([[step[0], 0.0, centre[0] - reach * step[0]], [0.0, step[1], centre[1] - reach * step[1]]])
    size, flags = (2 * reach + 1, 2 * reach + 1), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    grid = np.asarray(cv2.warpAffine(both, matrix, size, flags=flags, borderMode=cv2.BORDER_REPLICATE), np.float32)
    discs = _discs(pad, tone)
    told = np.zeros(1)
    for channel, share in ((0, 1.0), (1, _RED_SHARE)):
        told = told + share * _told(grid[:, :, channel], discs.templates[channel], discs)
    shift = np.array(list(itertools.product(np.arange(-_SHIFT, _SHIFT + 1) * _STEP, repeat=2)))[:, None, ::-1]
    sigma = np.sqrt(_OFF**2 + (_OFF_PX / half) ** 2)
    unlikely = ((shift**2 + (discs.shapes[:, :2] - 1.0) ** 2) / sigma**2).sum(axis=2)
    unlikely += 0.5 * (discs.shapes[:, 2] / _SLANT_SIGMA) ** 2
    score = _TELLS * float(step.prod()) * told * discs.areas - unlikely
    place = score.argmax(axis=0)
    best = np.argsort(-score[place, np.arange(len(place))])[:_SHAPES]
    place = place[best]
    return _Shapes(
        centre + half * shift[place, 0],
        half * discs.shapes[best, :2],
        discs.shapes[best, 2],
        unlikely[place, best],
    )


@dataclass(frozen=True, eq=False)
class _Discs:
    """Templates of N shapes on a grid of K points.

    shapes: (N, 3) half sides in the box's, slant. masks: (K, N). areas: (N,) points within. templates: darkness and
    redness (K, N), mean 0 and norm 1 within the mask.
    """

    shapes: Array
    masks: Plane
    areas: Array
    templates: tuple[Plane, Plane]


@lru_cache(maxsize=4)
def _discs(pad: PadSpec, tone: Tone) -> _Discs:
    what = print_of(pad, tone)
    assert what is not None
    assert pad.ring is not None
    shapes = np.array(list(itertools.product(_SIZES, _SIZES, _SLANTS)))
    y, x = np.mgrid[-_REACH : _REACH + 1, -_REACH : _REACH + 1].reshape(2, -1, 1) * _STEP
    a, b, slant = shapes.T
    radius = np.sqrt(((x / a) ** 2 - 2.0 * slant * x * y / (a * b) + (y / b) ** 2) / (1.0 - slant**2))
    masks = np.clip((1.12 - radius) / 0.1, 0.0, 1.0)
    at = np.arange(0.0, 2.0, 0.02)
    texture, texel = what.levels[3][:, :, 0], what.texel * 8
    rows, columns = np.indices(texture.shape) - (len(texture) / 2.0 - 0.5)
    bins = np.minimum((np.hypot(rows, columns) * (texel / 0.02)).astype(int), len(at) - 1).ravel()
    profile = np.bincount(bins, texture.ravel(), len(at)) / np.maximum(np.bincount(bins, minlength=len(at)), 1)
    inner = pad.ring.inner / pad.ring.outer
    templates = []
    for values, blur in ((profile * (at < 1.05), _BLUR), ((at > inner) & (at < 1.0), _RED_BLUR)):
        template = np.interp(radius, at, _blurred(np.asarray(values, np.float64), blur / 0.02))
        template = (template - (template * masks).sum(axis=0) / masks.sum(axis=0)) * masks
        template /= np.sqrt((template**2 / np.maximum(masks, 1e-9)).sum(axis=0))
        templates.append(np.ascontiguousarray(template, np.float32))
    return _Discs(shapes, np.asarray(masks, np.float32), masks.sum(axis=0), (templates[0], templates[1]))


def _blurred(profile: Array, sigma: float) -> Array:
    kernel = np.exp(-0.5 * (np.arange(-30, 31) / sigma) ** 2)
    smooth: Array = np.convolve(np.concatenate([profile[30:0:-1], profile]), kernel / kernel.sum(), "same")[30:]
    return smooth


def _told(grid: Plane, template: Plane, discs: _Discs) -> Floats:
    """Return what the templates tell at every place (P, N): minus the log of the share they leave unexplained."""
    side = 2 * _REACH + 1
    windows = np.lib.stride_tricks.sliding_window_view(grid - grid.mean(), (side, side)).reshape(-1, side * side)
    energy = (windows * windows) @ discs.masks - (windows @ discs.masks) ** 2 / discs.areas
    alike = (windows @ template) / np.sqrt(np.maximum(energy, 1e-6))
    told: Floats = -np.log(1.0 - np.clip(alike, 0.0, 0.98) ** 2)
    return told


@dataclass(frozen=True, eq=False)
class _Turns:
    """The print on rings around its middle: places (2, R, T), weights (R, 1), conjugate spectra along the rings."""

    places: Array
    weights: Array
    spectra: NDArray[np.complex128]


@lru_cache(maxsize=4)
def _turns(pad: PadSpec, tone: Tone) -> _Turns:
    what = print_of(pad, tone)
    assert what is not None
    texel = what.texel * 8
    texture = cv2.GaussianBlur(what.levels[3][:, :, 0], (0, 0), _BLUR / texel)
    angle, radii = np.arange(_TURNS) * (2.0 * np.pi / _TURNS), np.linspace(0.08, 1.06, _RADII)[:, None]
    places = np.stack([radii * np.cos(angle), radii * np.sin(angle)])
    column, row = (places / texel + (len(texture) / 2.0 - 0.5)).astype(np.float32)
    values = cv2.remap(texture, column, row, cv2.INTER_LINEAR).astype(np.float64)
    weights = radii / (radii.sum() * _TURNS)
    values -= (values * weights).sum()
    values /= math.sqrt(float((values**2 * weights).sum()))
    return _Turns(places, weights, np.conj(np.fft.rfft(values * weights, axis=1)))


def _find_turns(dark: Plane, shapes: _Shapes, pad: PadSpec, tone: Tone) -> list[tuple[int, float]]:
    """Return the best pairs of a shape and a turn in radians; half a turn is none, as an H looks the same."""
    turns = _turns(pad, tone)
    (u, v), n = turns.places, len(shapes.slants)
    (a, b), slant = shapes.halves.T[:, :, None, None], shapes.slants[:, None, None]
    other = np.sqrt(1.0 - slant**2)
    x = (a * u + shapes.centres[:, 0, None, None]).reshape(-1, _TURNS).astype(np.float32)
    y = (b * (slant * u + other * v) + shapes.centres[:, 1, None, None]).reshape(-1, _TURNS).astype(np.float32)
    sampled = cv2.remap(dark, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).reshape(n, _RADII, _TURNS)
    sampled = sampled - (sampled * turns.weights).sum(axis=(1, 2), keepdims=True)
    energy = (sampled**2 * turns.weights).sum(axis=(1, 2))
    around = np.fft.irfft((np.fft.rfft(sampled, axis=2) * turns.spectra).sum(axis=1), _TURNS, axis=1)
    half = _TURNS // 2
    alike = 0.5 * (around[:, :half] + around[:, half:]) / np.sqrt(np.maximum(energy, 1e-9))[:, None]
    area = 1.1 * np.pi * (a * b * other)[:, :, 0]
    score = -_TELLS * area * np.log(1.0 - np.clip(alike, 0.0, 0.98) ** 2) - shapes.unlikely[:, None]
    found = []
    for _ in range(_STARTS):
        i, turn = divmod(int(score.argmax()), half)
        found.append((i, turn * 2.0 * math.pi / _TURNS))
        apart = np.abs(np.arange(half) - turn)
        apart = np.minimum(apart, half - apart)
        score[:, apart <= 2] -= _OTHER
        score[i, apart <= 3] = -np.inf
    return found
