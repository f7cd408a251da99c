"""Signs and paint of roads, car parks and yards."""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from landtool.pad import PadSpec
from landtool.synth.signs.canvas import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    RED,
    WHITE,
    YELLOW,
    Canvas,
    Color,
    Picture,
    regular,
    shade_of,
)

_LIMITS = (5, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 120, 130)
_WORDS = (
    "SLOW",
    "STOP",
    "BUS",
    "TAXI",
    "KEEP CLEAR",
    "NO PARKING",
    "DANGER",
    "HOT",
    "LOADING",
    "FIRE",
    "24H",
    "HELLO",
    "HUT",
)


def speed_limit(rng: Generator, _: PadSpec) -> Picture:
    """Paint a red ring with a number, round or on a square board."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = Canvas(white)
    if rng.random() < 0.4:
        canvas.square(1.1, white)
    canvas.ring(0.95, 0.95 * float(rng.uniform(0.75, 0.85)), shade_of(rng, RED), white)
    number = str(rng.choice(_LIMITS))
    height = 0.72 if len(number) < 3 else 0.52
    canvas.text(number, 0.0, 0.0, height, shade_of(rng, BLACK), weight=int(rng.integers(500, 900)))
    return canvas.picture()


def no_entry(rng: Generator, _: PadSpec) -> Picture:
    """Paint a white bar on a red disc."""
    white, red = shade_of(rng, WHITE, 0.06), shade_of(rng, RED)
    canvas = Canvas(white)
    canvas.ring(0.97, 0.93, white, red)
    canvas.rect(-0.72, -0.16, 0.72, 0.16, white)
    return canvas.picture()


def no_parking(rng: Generator, _: PadSpec) -> Picture:
    """Paint a blue disc in a red ring, crossed once or twice."""
    red = shade_of(rng, RED)
    canvas = Canvas(red)
    canvas.ring(0.96, 0.8, red, shade_of(rng, BLUE))
    canvas.bar((-0.6, -0.6), (0.6, 0.6), 0.16, red)
    if rng.random() < 0.5:
        canvas.bar((0.6, -0.6), (-0.6, 0.6), 0.16, red)
    return canvas.picture()


def forbidden(rng: Generator, _: PadSpec) -> Picture:
    """Paint a red ring crossed by a red bar, over a shape or a turning arrow."""
    white, red, dark = shade_of(rng, WHITE, 0.06), shade_of(rng, RED), shade_of(rng, BLACK)
    canvas = Canvas(white)
    if rng.random() < 0.4:
        canvas.square(1.1, white)
    canvas.ring(0.95, 0.79, red, white)
    side = float(rng.choice([-1.0, 1.0]))
    if rng.random() < 0.5:
        canvas.arrow([[-0.25 * side, 0.5], [-0.25 * side, -0.15], [0.5 * side, -0.15]], 0.16, dark)
    else:
        canvas.rect(-0.5, -0.15, 0.5, 0.25, dark)
        canvas.disc(-0.3, 0.28, 0.13, dark)
        canvas.disc(0.3, 0.28, 0.13, dark)
    canvas.bar((-0.58 * side, -0.58), (0.58 * side, 0.58), 0.13, red)
    return canvas.picture()


def mandatory(rng: Generator, _: PadSpec) -> Picture:
    """Paint a white arrow on a blue disc."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = Canvas(white)
    canvas.ring(0.97, 0.92, white, shade_of(rng, BLUE))
    side = float(rng.choice([-1.0, 1.0]))
    lines = (
        [[0.0, 0.65], [0.0, -0.7]],
        [[-0.2 * side, 0.6], [-0.2 * side, -0.2], [0.65 * side, -0.2]],
        [[-0.6 * side, 0.0], [0.7 * side, 0.0]],
    )
    canvas.arrow(lines[int(rng.integers(3))], 0.2, white)
    return canvas.picture()


def warning(rng: Generator, _: PadSpec) -> Picture:
    """Paint a triangle with a red border around a mark, a letter or nothing."""
    red, dark = shade_of(rng, RED), shade_of(rng, BLACK)
    inside = shade_of(rng, (WHITE, WHITE, YELLOW)[int(rng.integers(3))], 0.06)
    canvas = Canvas(red)
    canvas.polygon(regular(3, 1.12) + [0.0, 0.25], red)
    canvas.polygon(regular(3, 0.74) + [0.0, 0.25], inside)
    kind = int(rng.integers(4))
    if kind == 0:
        canvas.bar((0.0, -0.2), (0.0, 0.3), 0.13, dark)
        canvas.disc(0.0, 0.46, 0.08, dark)
    elif kind == 1:
        canvas.text(str(rng.choice(list("HXTA!"))), 0.0, 0.24, 0.5, dark)
    elif kind == 2:
        canvas.line([[-0.15, 0.5], [0.12, 0.2], [-0.1, 0.0], [0.05, -0.2]], 0.1, dark)
    return canvas.picture()


def give_way(rng: Generator, _: PadSpec) -> Picture:
    """Paint a triangle on its tip."""
    canvas = Canvas(shade_of(rng, RED))
    canvas.polygon(regular(3, 1.1, math.pi) - [0.0, 0.25], shade_of(rng, RED))
    canvas.polygon(regular(3, 0.7, math.pi) - [0.0, 0.25], shade_of(rng, WHITE, 0.06))
    return canvas.picture()


def stop(rng: Generator, _: PadSpec) -> Picture:
    """Paint a stop sign."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = Canvas(white)
    canvas.polygon(regular(8, 1.02, math.pi / 8.0), white)
    canvas.polygon(regular(8, 0.95, math.pi / 8.0), shade_of(rng, RED))
    canvas.text("STOP", 0.0, 0.0, 0.5, white, weight=700)
    return canvas.picture()


def priority(rng: Generator, _: PadSpec) -> Picture:
    """Paint a yellow diamond, or a diamond for dangerous goods."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = Canvas(white)
    canvas.polygon(regular(4, 0.99), white)
    canvas.polygon(regular(4, 0.7), shade_of(rng, (YELLOW, ORANGE, RED)[int(rng.integers(3))]))
    return canvas.picture()


def end_of_limit(rng: Generator, _: PadSpec) -> Picture:
    """Paint a white disc with a dark rim, crossed by dark lines."""
    white, dark = shade_of(rng, WHITE, 0.06), shade_of(rng, BLACK)
    canvas = Canvas(dark)
    canvas.ring(0.95, 0.91, dark, white)
    for offset in (-0.14, 0.0, 0.14):
        canvas.bar((0.58 + offset, -0.58 + offset), (-0.58 + offset, 0.58 + offset), 0.06, dark)
    return canvas.picture()


def parking(rng: Generator, _: PadSpec) -> Picture:
    """Paint a white P, or another letter, on blue."""
    canvas = Canvas(WHITE)
    white = shade_of(rng, WHITE, 0.06)
    canvas.square(1.1, shade_of(rng, BLUE))
    letter = str(rng.choice(list("PPPIHB")))
    canvas.text(letter, 0.0, 0.0, float(rng.uniform(0.9, 1.3)), white, weight=int(rng.integers(600, 900)))
    return canvas.picture()


def disabled(rng: Generator, _: PadSpec) -> Picture:
    """Paint a wheelchair, on a blue field or on what is there."""
    white = shade_of(rng, WHITE, 0.1)
    canvas = Canvas(white)
    if rng.random() < 0.7:
        canvas.square(1.1, shade_of(rng, BLUE))
    angle = np.linspace(-0.3, math.pi + 0.7, 24)
    canvas.line(np.column_stack([0.45 * np.cos(angle) - 0.1, 0.45 * np.sin(angle) + 0.3]), 0.1, white)
    canvas.disc(-0.1, -0.75, 0.13, white)
    canvas.line([[-0.1, -0.5], [-0.05, 0.1], [0.4, 0.1], [0.58, 0.6], [0.72, 0.55]], 0.13, white)
    canvas.line([[-0.08, -0.2], [0.35, -0.2]], 0.1, white)
    return canvas.picture()


def road_arrow(rng: Generator, _: PadSpec) -> Picture:
    """Paint an arrow of road paint."""
    paint = _road_paint(rng)
    canvas = Canvas(paint)
    side, width = float(rng.choice([-1.0, 1.0])), float(rng.uniform(0.12, 0.2))
    lines = ([[0.0, 0.95], [0.0, -0.9]], [[-0.1, 0.95], [-0.1, -0.3], [0.65 * side, -0.3]])
    canvas.arrow(lines[int(rng.integers(2))], width, paint)
    return canvas.picture()


def crosswalk(rng: Generator, _: PadSpec) -> Picture:
    """Paint a piece of a pedestrian crossing."""
    paint = _road_paint(rng)
    canvas = Canvas(paint)
    bars = int(rng.integers(3, 8))
    for i in range(bars):
        left = -0.98 + i * 1.96 / (bars - 0.5)
        canvas.rect(left, -0.9, left + 0.98 / (bars - 0.5), 0.9, paint)
    return canvas.picture()


def hatching(rng: Generator, _: PadSpec) -> Picture:
    """Paint a box of slanted stripes, or a box crossed, on what is there."""
    paint = _road_paint(rng)
    canvas = Canvas(paint)
    corners = [(-0.92, -0.92), (0.92, -0.92), (0.92, 0.92), (-0.92, 0.92)]
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        canvas.bar(a, b, 0.1, paint)
    if rng.random() < 0.5:
        canvas.bar(corners[0], corners[2], 0.1, paint)
        canvas.bar(corners[1], corners[3], 0.1, paint)
    else:
        for offset in np.linspace(-1.4, 1.4, 7):
            low, high = max(-0.92, offset - 0.92), min(0.92, offset + 0.92)
            canvas.bar((low, low - offset), (high + 1e-6, high - offset), 0.1, paint)
    return canvas.picture()


def lettering(rng: Generator, _: PadSpec) -> Picture:
    """Paint a word or two with road paint, or on a plate."""
    plate = rng.random() < 0.4
    paint = shade_of(rng, BLACK) if plate else _road_paint(rng)
    canvas = Canvas(paint)
    if plate:
        canvas.rect(-1.1, -0.75, 1.1, 0.75, shade_of(rng, (WHITE, YELLOW, ORANGE)[int(rng.integers(3))]))
    words = str(rng.choice(_WORDS)).split()
    for i, word in enumerate(words):
        canvas.text(word, 0.0, 0.55 * (i - (len(words) - 1) / 2.0), 0.42 if len(words) > 1 else 0.6, paint, weight=700)
    return canvas.picture()


def number_plate(rng: Generator, _: PadSpec) -> Picture:
    """Paint a large number, as of a roof, a gate or a parking bay."""
    paint, ground = (BLACK, WHITE) if rng.random() < 0.5 else (WHITE, (GREY, BLUE, RED)[int(rng.integers(3))])
    canvas = Canvas(WHITE)
    canvas.square(1.1, shade_of(rng, ground))
    canvas.text(str(rng.integers(0, 1000)), 0.0, 0.0, 0.9, shade_of(rng, paint), weight=int(rng.integers(400, 900)))
    return canvas.picture()


def _road_paint(rng: Generator) -> Color:
    return shade_of(rng, WHITE if rng.random() < 0.8 else YELLOW, 0.15)
