"""Pictures that cost nothing to draw: functions of this module, so that other processes find them."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from landtool.camera import Camera
from landtool.errors import InputError
from landtool.geometry import Pose
from landtool.pad import PadSpec
from landtool.synth.sample import Sample, Truth

Photos = tuple[Path, ...]


@dataclass(frozen=True)
class PlainDomain:
    """As much of a domain as writing a dataset needs. drawn: a file to which every drawn index is added."""

    hfov_deg: tuple[float, float] = (50.0, 100.0)
    drawn: str = ""
    trouble_at: int = -1


def draw(
    domain: PlainDomain,
    pad: PadSpec,  # noqa: ARG001 - as `Draw` has it
    size: tuple[int, int],
    seed: int,
    index: int,
    photos: Photos,  # noqa: ARG001
    *,
    clear: bool = False,
) -> Sample:
    """Draw noise with a white box in two of three pictures; those are in fog, their clear twins are white."""
    rng = np.random.default_rng([seed, index])
    width, height = size
    image = rng.integers(0, 120, (height, width, 3), np.uint8)
    present = bool(index % 3)
    camera = Camera.from_hfov(width, height, float(rng.uniform(*domain.hfov_deg)))
    truth = Truth(camera, False, ground="sand", signs=("no H", "ring"))
    if present:
        image[10:20, 20:50] = 255
        corners = np.array([[30.0, 12.0], [34.0, 12.0], [34.0, 16.0], [30.0, 16.0]])
        truth = Truth(
            camera,
            True,
            visible_fraction=1.0,
            box_px=np.array([19.5, 9.5, 49.5, 19.5]),
            camera_T_pad=Pose.from_rotvec((0.1, 0.2, 3.0), (0.0, 3.0, 0.0)),
            tag_corners_px=corners,
            size_px=30.0,
            height_m=3.0,
            distance_m=3.01,
            beta_per_m=0.02,
            airlight=(0.5, 0.6, 0.7),
            ground="sand",
            carrier="box",
            applied=(("jpeg", 90.0), ("blur", "motion")),
        )
    drawn = getattr(domain, "drawn", "")  # a whole `Domain` has none
    if drawn:
        with Path(drawn).open("a") as file:
            file.write(f"{index}\n")
    _, jpeg = cv2.imencode(".jpg", image)
    _, white = cv2.imencode(".jpg", np.full_like(image, 255))
    return Sample(jpeg.tobytes(), truth, white.tobytes() if clear and present else None)


def draw_until_trouble(
    domain: PlainDomain, pad: PadSpec, size: tuple[int, int], seed: int, index: int, photos: Photos, clear: bool = False
) -> Sample:
    """Draw, but be interrupted at one picture."""
    if index == domain.trouble_at:
        raise KeyboardInterrupt
    return draw(domain, pad, size, seed, index, photos, clear=clear)


def draw_or_fail(
    domain: PlainDomain, pad: PadSpec, size: tuple[int, int], seed: int, index: int, photos: Photos, clear: bool = False
) -> Sample:
    """Draw, but fail at one picture with an error for the user."""
    if index == domain.trouble_at:
        raise InputError("is bad", file="photo.jpg", hint="remove it")
    return draw(domain, pad, size, seed, index, photos, clear=clear)


def draw_and_die(
    domain: PlainDomain, pad: PadSpec, size: tuple[int, int], seed: int, index: int, photos: Photos, clear: bool = False
) -> Sample:
    """Draw, but be killed at one picture, as by a system without memory."""
    if index == domain.trouble_at:
        os.kill(os.getpid(), signal.SIGKILL)
    return draw(domain, pad, size, seed, index, photos, clear=clear)


def draw_slowly(
    domain: PlainDomain, pad: PadSpec, size: tuple[int, int], seed: int, index: int, photos: Photos, clear: bool = False
) -> Sample:
    """Draw so that a test has the time to stop it."""
    time.sleep(0.02)
    return draw(domain, pad, size, seed, index, photos, clear=clear)
