"""Round and patterned things that lie about: covers, tyres, codes and test charts."""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from landtool.families import tag_family
from landtool.pad import PadSpec
from landtool.synth.signs.canvas import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    RED,
    WHITE,
    YELLOW,
    Canvas,
    Picture,
    regular,
    shade_of,
    times,
)

_IRON = (58, 62, 66)


def manhole(rng: Generator, _: PadSpec) -> Picture:
    """Paint an iron cover in its frame."""
    iron = shade_of(rng, _IRON, 0.35)
    dark, bright = times(iron, 0.55), times(iron, 1.35)
    canvas = Canvas(iron)
    canvas.ring(0.97, 0.86, bright, dark)
    canvas.disc(0.0, 0.0, 0.83, iron)
    step, kind = float(rng.uniform(0.09, 0.16)), int(rng.integers(3))
    places = np.arange(-0.9, 0.9, step)
    for x in places:
        for y in places:
            if math.hypot(x, y) > 0.72:
                continue
            if kind == 0:
                canvas.disc(x, y, 0.33 * step, bright)
            elif kind == 1:
                canvas.rect(x - 0.3 * step, y - 0.3 * step, x + 0.3 * step, y + 0.3 * step, dark)
            elif (round((x - places[0]) / step) + round((y - places[0]) / step)) % 2:
                canvas.bar((x - 0.4 * step, y), (x + 0.4 * step, y), 0.3 * step, bright)
    canvas.disc(float(rng.uniform(-0.6, 0.6)), 0.55, 0.05, dark)
    return canvas.picture()


def drain(rng: Generator, _: PadSpec) -> Picture:
    """Paint a grate over a drain."""
    iron = shade_of(rng, _IRON, 0.35)
    canvas = Canvas(iron)
    canvas.square(0.96, iron)
    for y in np.linspace(-0.8, 0.72, int(rng.integers(6, 11))):
        canvas.rect(-0.82, y, 0.82, y + 0.08, (10, 10, 10))
    return canvas.picture()


def tyre(rng: Generator, _: PadSpec) -> Picture:
    """Paint a tyre on its side, with its rim or through it what is there."""
    rubber = shade_of(rng, (38, 38, 38), 0.3)
    canvas = Canvas(rubber)
    inner = float(rng.uniform(0.45, 0.62))
    canvas.arc(0.96, inner, 0.0, 2.0 * math.pi, rubber)
    lighter = (rubber[0] + 14, rubber[1] + 14, rubber[2] + 14)
    for i in range(28):
        angle = i * math.pi / 14.0
        canvas.bar(
            (0.86 * math.cos(angle), 0.86 * math.sin(angle)),
            (0.95 * math.cos(angle), 0.95 * math.sin(angle)),
            0.05,
            lighter,
        )
    canvas.arc(0.80, 0.77, 0.0, 2.0 * math.pi, lighter)
    if rng.random() < 0.5:
        canvas.disc(0.0, 0.0, inner, shade_of(rng, (165, 165, 165), 0.3))
        for corner in regular(5, 0.62 * inner, float(rng.uniform(0.0, 1.0))):
            canvas.disc(float(corner[0]), float(corner[1]), 0.25 * inner, rubber)
    return canvas.picture()


def lifebuoy(rng: Generator, _: PadSpec) -> Picture:
    """Paint a ring buoy in red, or orange, and white."""
    red, white = shade_of(rng, RED if rng.random() < 0.6 else ORANGE), shade_of(rng, WHITE, 0.06)
    canvas = Canvas(red)
    inner, turn = float(rng.uniform(0.52, 0.72)), float(rng.uniform(0.0, math.pi))
    canvas.arc(0.94, inner, 0.0, 2.0 * math.pi, red)
    for i in range(4):
        start = turn + i * math.pi / 2.0
        canvas.arc(0.95, inner - 0.01, start, start + float(rng.uniform(0.3, 0.5)), white)
    return canvas.picture()


def wreath(rng: Generator, _: PadSpec) -> Picture:
    """Paint a ring of leaves or flowers."""
    base = (shade_of(rng, GREEN, 0.3), shade_of(rng, RED, 0.2))[int(rng.integers(2))]
    canvas = Canvas(base)
    shades = [shade_of(rng, base, 0.5) for _i in range(6)]
    for angle, away in zip(rng.uniform(0.0, 2.0 * math.pi, 130), rng.uniform(0.62, 0.88, 130), strict=True):
        x, y = away * math.cos(angle), away * math.sin(angle)
        canvas.disc(x, y, float(rng.uniform(0.05, 0.1)), shades[int(rng.integers(6))])
    return canvas.picture()


def coiled_hose(rng: Generator, _: PadSpec) -> Picture:
    """Paint a hose or a cable in a coil."""
    color = shade_of(rng, (RED, ORANGE, YELLOW, BLUE, GREEN, BLACK)[int(rng.integers(6))], 0.2)
    canvas = Canvas(color)
    turns = int(rng.integers(2, 6))
    angle = np.linspace(0.0, 2.0 * math.pi * turns, 40 * turns)
    away = 0.85 - 0.06 * angle / (2.0 * math.pi) + 0.015 * np.sin(angle * rng.uniform(1.2, 2.6))
    points = np.column_stack([away * np.cos(angle), away * np.sin(angle)])
    dark = (color[0] // 2, color[1] // 2, color[2] // 2)
    canvas.line(points, 0.055, dark)
    canvas.line(points, 0.03, color)
    return canvas.picture()


def chessboard(rng: Generator, _: PadSpec) -> Picture:
    """Paint a calibration chessboard, on paper."""
    canvas = _paper(rng)
    n = int(rng.integers(4, 10))
    canvas.modules(
        (np.add.outer(np.arange(n), np.arange(n)) % 2).astype(np.bool_), 0.0, 0.0, 0.85, shade_of(rng, BLACK), WHITE
    )
    return canvas.picture()


def charuco(rng: Generator, _: PadSpec) -> Picture:
    """Paint a chessboard with small tags in its white squares."""
    canvas = _paper(rng)
    n, dark = int(rng.integers(3, 6)), shade_of(rng, BLACK)
    canvas.modules((np.add.outer(np.arange(n), np.arange(n)) % 2).astype(np.bool_), 0.0, 0.0, 0.88, dark, WHITE)
    family, step = tag_family("tag16h5"), 1.76 / n
    for row in range(n):
        for column in range((row + 1) % 2, n, 2):
            modules = family.modules(int(rng.integers(len(family.codes))))[1:-1, 1:-1]
            x, y = -0.88 + (column + 0.5) * step, -0.88 + (row + 0.5) * step
            canvas.modules(modules, x, y, 0.36 * step, dark, WHITE)
    return canvas.picture()


def matrix_code(rng: Generator, _: PadSpec) -> Picture:
    """Paint a code that looks like a QR code and says nothing."""
    canvas = _paper(rng)
    n = int(rng.choice([21, 25, 29]))
    white = rng.random((n, n)) < 0.5
    eye = np.pad(np.pad(np.pad(np.zeros((3, 3), np.bool_), 1, constant_values=True), 1), (0, 1), constant_values=True)
    white[:8, :8], white[:8, -8:], white[-8:, :8] = eye, eye[:, ::-1], eye[::-1]
    canvas.modules(white, 0.0, 0.0, float(rng.uniform(0.6, 0.85)), shade_of(rng, BLACK), WHITE)
    return canvas.picture()


def survey_marker(rng: Generator, _: PadSpec) -> Picture:
    """Paint a ground control point: quarters of a square or a disc, or a cross."""
    canvas = _paper(rng)
    dark = shade_of(rng, (BLACK, BLACK, RED, ORANGE)[int(rng.integers(4))])
    kind = int(rng.integers(3))
    if kind == 0:
        canvas.modules(np.eye(2, dtype=np.bool_), 0.0, 0.0, float(rng.uniform(0.6, 0.9)), dark, WHITE)
    elif kind == 1:
        canvas.arc(0.85, 0.0, 0.0, math.pi / 2.0, dark)
        canvas.arc(0.85, 0.0, math.pi, 1.5 * math.pi, dark)
        canvas.arc(0.88, 0.84, 0.0, 2.0 * math.pi, dark)
    else:
        canvas.bar((-0.8, -0.8), (0.8, 0.8), 0.25, dark)
        canvas.bar((0.8, -0.8), (-0.8, 0.8), 0.25, dark)
    return canvas.picture()


def poster(rng: Generator, _: PadSpec) -> Picture:
    """Paint a sheet with blocks of colour and lines of text."""
    canvas = Canvas()
    canvas.square(1.1, shade_of(rng, WHITE, 0.1))
    colors = (RED, BLUE, YELLOW, GREEN, ORANGE, BLACK)
    for _i in range(int(rng.integers(2, 6))):
        x, y = rng.uniform(-0.9, 0.5, 2)
        w, h = rng.uniform(0.2, 0.9, 2)
        canvas.rect(x, y, min(x + w, 0.95), min(y + h, 0.95), shade_of(rng, colors[int(rng.integers(6))], 0.3))
    for y in np.arange(-0.8, 0.8, 0.14):
        if rng.random() < 0.5:
            canvas.bar((-0.85, y), (float(rng.uniform(0.0, 0.85)), y), 0.04, shade_of(rng, BLACK))
    return canvas.picture()


def _paper(rng: Generator) -> Canvas:
    canvas = Canvas()
    canvas.square(1.1, shade_of(rng, WHITE, 0.08))
    return canvas
