"""Signs that share one or two of the pad's parts: its ring, its letter, its tag or its board."""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from landtool.families import tag_family
from landtool.pad import Letter, PadSpec, Ring
from landtool.synth.signs.canvas import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    RED,
    WHITE,
    YELLOW,
    Canvas,
    Color,
    Picture,
    shade_of,
)

# no orange or brown: a faded red ring is the pad's own
_OTHER_RINGS = (BLUE, BLACK, YELLOW, GREEN, PURPLE, GREY)
_OTHER_LETTERS = "INMAKXEFTLUWVZ"
_WORDS = ("STOP", "HALT", "TAXI", "BUS", "HELP", "EXIT", "ZONE", "3.5t", "2.1m", "7.5t", "START")


def _scale(pad: PadSpec) -> float:
    """Return how many of the canvas's units are one ring diameter, when the pad's board fills the canvas."""
    return 2.0 / (pad.board.side if pad.board else 1.1)


def _board(rng: Generator, color: Color = WHITE) -> Canvas:
    """Return a canvas with a square board, or a round plate."""
    canvas = Canvas(color)
    if rng.random() < 0.75:
        canvas.square(1.1, color)
    else:
        canvas.disc(0.0, 0.0, float(rng.uniform(0.93, 0.99)), color)
    return canvas


def _ring(canvas: Canvas, rng: Generator, pad: PadSpec, color: Color, inside: Color) -> None:
    """Draw a ring like the pad's, a little thicker or thinner."""
    ring, half = pad.ring or Ring(), _scale(pad) / 2.0
    outer = min(ring.outer * half, 0.95)
    inner = outer * ring.inner / ring.outer * rng.uniform(0.93, 1.04)
    canvas.ring(outer, inner, color, inside)


def _h(canvas: Canvas, rng: Generator, pad: PadSpec, color: Color, size: float = 1.0) -> None:
    letter, scale = pad.letter or Letter(), _scale(pad) * size
    stroke = letter.stroke * scale * rng.uniform(0.8, 1.3)
    canvas.letter_h(letter.height * scale, letter.width * scale * rng.uniform(0.85, 1.05), stroke, color)


def _tag(canvas: Canvas, rng: Generator, pad: PadSpec, half: float, family: str = "tag36h11") -> None:
    """Draw a tag that is not one of the pad's, with its quiet zone."""
    known = tag_family(family)
    own = {tag.id for tag in pad.tags if tag.family == family}
    other = [i for i in range(len(known.codes)) if i not in own]
    modules = known.modules(int(rng.choice(other)))
    dark, light = shade_of(rng, BLACK), shade_of(rng, WHITE, 0.06)
    canvas.modules(modules, 0.0, 0.0, half * known.total_modules / known.border_modules, dark, light)


def empty_ring(rng: Generator, pad: PadSpec) -> Picture:
    """Paint the pad's ring with nothing in it."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = _board(rng, white)
    _ring(canvas, rng, pad, shade_of(rng, RED), white)
    return canvas.picture()


def ring_letter(rng: Generator, pad: PadSpec) -> Picture:
    """Paint the pad's ring around another letter."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = _board(rng, white)
    _ring(canvas, rng, pad, shade_of(rng, RED), white)
    letter, weight = str(rng.choice(list(_OTHER_LETTERS))), int(rng.integers(400, 900))
    canvas.text(letter, 0.0, 0.0, float(rng.uniform(0.7, 1.05)), shade_of(rng, BLACK), weight=weight)
    return canvas.picture()


def ring_word(rng: Generator, pad: PadSpec) -> Picture:
    """Paint the pad's ring around a word."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = _board(rng, white)
    _ring(canvas, rng, pad, shade_of(rng, RED), white)
    word = str(rng.choice(_WORDS))
    canvas.text(word, 0.0, 0.0, 1.5 / len(word), shade_of(rng, BLACK), weight=int(rng.integers(400, 900)))
    return canvas.picture()


def ring_tag(rng: Generator, pad: PadSpec) -> Picture:
    """Paint the pad's ring around another tag, without an H."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = _board(rng, white)
    _ring(canvas, rng, pad, shade_of(rng, RED), white)
    _tag(canvas, rng, pad, float(rng.uniform(0.14, 0.45)))
    return canvas.picture()


def other_ring(rng: Generator, pad: PadSpec) -> Picture:
    """Paint the pad with a ring of another colour."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = _board(rng, white)
    _ring(canvas, rng, pad, shade_of(rng, _OTHER_RINGS[int(rng.integers(len(_OTHER_RINGS)))]), white)
    _h(canvas, rng, pad, shade_of(rng, BLACK))
    if rng.random() < 0.6:
        _tag(canvas, rng, pad, 0.08 * _scale(pad))
    return canvas.picture()


def thin_ring(rng: Generator, pad: PadSpec) -> Picture:
    """Paint a small H in a thin dark circle, as the drawing of a helipad."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = _board(rng, white)
    dark = shade_of(rng, BLACK)
    outer = float(rng.uniform(0.6, 0.85))
    canvas.ring(outer, outer - float(rng.uniform(0.015, 0.04)), dark, white)
    _h(canvas, rng, pad, dark, size=float(rng.uniform(0.3, 0.8)) * outer)
    if rng.random() < 0.6:
        canvas.polygon(np.array([[0.0, -0.12], [0.1, 0.06], [-0.1, 0.06]]) + [0.0, -outer + 0.2], dark)
    return canvas.picture()


def letter_alone(rng: Generator, pad: PadSpec) -> Picture:
    """Paint an H, with a tag or without, on a board without a ring."""
    canvas = _board(rng, shade_of(rng, WHITE, 0.06))
    _h(canvas, rng, pad, shade_of(rng, BLACK), size=float(rng.uniform(0.8, 1.4)))
    if rng.random() < 0.5:
        _tag(canvas, rng, pad, 0.08 * _scale(pad))
    return canvas.picture()


def letter_in_square(rng: Generator, pad: PadSpec) -> Picture:
    """Paint an H in a square frame."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = Canvas(white)
    canvas.square(1.1, white)
    outer = float(rng.uniform(0.8, 0.92))
    canvas.square(outer, shade_of(rng, (RED, RED, BLUE, BLACK, YELLOW)[int(rng.integers(5))]))
    canvas.square(outer - float(rng.uniform(0.06, 0.18)), white)
    _h(canvas, rng, pad, shade_of(rng, BLACK), size=float(rng.uniform(0.8, 1.1)))
    return canvas.picture()


def light_on_dark(rng: Generator, pad: PadSpec) -> Picture:
    """Paint a white H on a dark or blue or red board, as of hospitals."""
    canvas = _board(rng, shade_of(rng, (BLACK, BLUE, GREEN, GREY, RED)[int(rng.integers(5))]))
    _h(canvas, rng, pad, shade_of(rng, WHITE, 0.06), size=float(rng.uniform(0.9, 1.4)))
    return canvas.picture()


def dashed_ring(rng: Generator, pad: PadSpec) -> Picture:
    """Paint the pad with most of its ring missing, in dashes."""
    canvas = _board(rng, shade_of(rng, WHITE, 0.06))
    red, dashes, share = shade_of(rng, RED), int(rng.integers(3, 9)), float(rng.uniform(0.25, 0.45))
    for i in range(dashes):
        start = (i + rng.uniform(0.0, 0.1)) * 2.0 * math.pi / dashes
        canvas.arc(0.91, 0.76, start, start + share * 2.0 * math.pi / dashes, red)
    _h(canvas, rng, pad, shade_of(rng, BLACK))
    return canvas.picture()


def red_disc(rng: Generator, pad: PadSpec) -> Picture:
    """Paint a red disc, plain or with a white H."""
    canvas = _board(rng, shade_of(rng, WHITE, 0.06))
    canvas.disc(0.0, 0.0, float(rng.uniform(0.6, 0.92)), shade_of(rng, RED))
    if rng.random() < 0.4:
        _h(canvas, rng, pad, shade_of(rng, WHITE, 0.06), size=0.8)
    return canvas.picture()


def target_rings(rng: Generator, _: PadSpec) -> Picture:
    """Paint a target of red, or dark, and white rings."""
    white = shade_of(rng, WHITE, 0.06)
    canvas = _board(rng, white)
    color = shade_of(rng, RED if rng.random() < 0.7 else BLACK)
    rings = int(rng.integers(2, 6))
    for i in range(2 * rings, 0, -1):
        canvas.disc(0.0, 0.0, 0.93 * i / (2 * rings), white if i % 2 else color)
    return canvas.picture()


def double_ring(rng: Generator, _: PadSpec) -> Picture:
    """Paint two thin red rings around a cross, a dot or a number."""
    white, red = shade_of(rng, WHITE, 0.06), shade_of(rng, RED)
    canvas = _board(rng, white)
    canvas.ring(0.92, 0.86, red, white)
    canvas.ring(0.72, 0.66, red, white)
    kind = int(rng.integers(3))
    if kind == 0:
        canvas.bar((-0.4, 0.0), (0.4, 0.0), 0.12, red)
        canvas.bar((0.0, -0.4), (0.0, 0.4), 0.12, red)
    elif kind == 1:
        canvas.disc(0.0, 0.0, 0.2, red)
    else:
        canvas.text(str(rng.integers(1, 99)), 0.0, 0.0, 0.6, shade_of(rng, BLACK))
    return canvas.picture()


def tag_on_board(rng: Generator, pad: PadSpec) -> Picture:
    """Paint another tag of the pad's family, alone on a board."""
    canvas = Canvas()
    canvas.square(1.1, shade_of(rng, (WHITE, WHITE, GREY, ORANGE)[int(rng.integers(4))], 0.08))
    _tag(canvas, rng, pad, float(rng.uniform(0.4, 0.78)), pad.tags[0].family if pad.tags else "tag36h11")
    return canvas.picture()


def small_family_tag(rng: Generator, pad: PadSpec) -> Picture:
    """Paint a tag of a family with few modules, alone on a board."""
    canvas = Canvas()
    canvas.square(1.1, shade_of(rng, WHITE, 0.08))
    _tag(canvas, rng, pad, float(rng.uniform(0.4, 0.72)), ("tag16h5", "tag25h9")[int(rng.integers(2))])
    return canvas.picture()


def painted_helipad(rng: Generator, pad: PadSpec) -> Picture:
    """Paint a helipad's ring and H with road paint, on dark ground or on what is there."""
    paint = shade_of(rng, (WHITE, YELLOW)[int(rng.integers(2))])
    ground = shade_of(rng, (GREY, (70, 72, 74), (60, 90, 50), (110, 60, 30))[int(rng.integers(4))])
    canvas = Canvas(ground)
    canvas.square(1.1, ground)
    if rng.random() < 0.3:
        canvas.disc(0.0, 0.0, 0.95, shade_of(rng, (GREEN, BLUE, (60, 60, 130))[int(rng.integers(3))]))
    width = float(rng.uniform(0.03, 0.1))
    canvas.arc(0.9, 0.9 - width, 0.0, 2.0 * math.pi, paint)
    _h(canvas, rng, pad, shade_of(rng, paint), size=float(rng.uniform(0.8, 1.2)))
    return canvas.picture()


def triangle_helipad(rng: Generator, pad: PadSpec) -> Picture:
    """Paint an H in a triangle, as on old helipads."""
    ground, paint = shade_of(rng, GREY), shade_of(rng, WHITE)
    canvas = Canvas(ground)
    canvas.square(1.1, ground)
    for radius, color in ((0.98, paint), (0.8, ground)):
        angle = np.array([-90.0, 30.0, 150.0]) * math.pi / 180.0
        canvas.polygon(radius * np.column_stack([np.cos(angle), np.sin(angle)]) + [0.0, 0.2], color)
    _h(canvas, rng, pad, paint, size=0.45)
    return canvas.picture()


def hospital_cross(rng: Generator, pad: PadSpec) -> Picture:
    """Paint a hospital's helipad: a red H on a white cross."""
    ground, white = shade_of(rng, (GREY, RED, GREEN)[int(rng.integers(3))]), shade_of(rng, WHITE, 0.06)
    canvas = Canvas(ground)
    canvas.square(1.1, ground)
    arm = float(rng.uniform(0.3, 0.38))
    canvas.rect(-0.95, -arm, 0.95, arm, white)
    canvas.rect(-arm, -0.95, arm, 0.95, white)
    _h(canvas, rng, pad, shade_of(rng, RED), size=0.5)
    return canvas.picture()
