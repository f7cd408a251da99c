"""One picture of a data set, from its number alone: a scene drawn at random, rendered, photographed, with its truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from landtool.errors import OutputError, UsageError
from landtool.pad import PadSpec
from landtool.synth.compose import Rendered
from landtool.synth.domain import Domain, uniform
from landtool.synth.legible import LEAST_LEGIBLE, legibility
from landtool.synth.photograph import clear_twin, light_of, random_sensor
from landtool.synth.random_scene import Drawn, draw_scene
from landtool.synth.sample import Sample, Truth
from landtool.synth.sensor import Sensor
from landtool.synth.truth import seen_target
from landtool.synth.viewpoint import size_px
from landtool.types import Image

# how often a scene is drawn again whose pad nobody can see, and how much of what must be in the picture may be hidden
_TRIES, _OF_LEAST = 50, 0.9
# of a clear twin: with all of the colours' resolution it is 38 dB or more from the picture as it was, a dehazed picture
# 15 to 30; PNG takes three times the room
_TWIN_JPEG = (
    *(cv2.IMWRITE_JPEG_QUALITY, 95),
    *(cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444),
)


def make_sample(
    domain: Domain,
    pad: PadSpec,
    size: tuple[int, int],
    seed: int,
    index: int,
    photos: Sequence[Path] = (),
    *,
    clear: bool = False,
) -> Sample:
    """Return picture `index` of the data set of a seed; size: (width, height) in pixels. The same in any process.

    clear: of a picture in fog draw the same in clear air, too.

    Raises UsageError when the domain has no picture of the pad, or hardly one in which it can be made out.
    """
    rng = np.random.default_rng([seed, index])
    for _ in range(_TRIES):
        drawn = draw_scene(domain, pad, size, photos, rng)
        linear, rendered = light_of(drawn.scene, drawn.view)
        truth = _truth(drawn, rendered)
        present = drawn.scene.target is not None
        # other bodies may stand before the pad: one that nobody can see is no example of a pad
        if present and truth.visible_fraction < _OF_LEAST * domain.least_visible:
            continue
        sensor = random_sensor(domain, rng)
        image = sensor.picture(linear, rng)
        quality = round(uniform(rng, domain.jpeg_quality))
        sample = Sample(
            _jpeg(image, (cv2.IMWRITE_JPEG_QUALITY, quality), index),
            replace(truth, applied=_applied(drawn, sensor, quality)),
        )
        # nor is one that is drowned in fog, noise or darkness: it would teach to see pads where nothing is
        if not present or legibility(sample.image, rendered, pad) >= LEAST_LEGIBLE:
            return _with_twin(sample, drawn, sensor, index) if clear else sample
    raise UsageError(
        f"picture {index}: in {_TRIES} scenes drawn one after another nobody could make out the pad",
        hint="make the pictures lighter, larger or nearer, or the fog, the noise, the blur or the occlusion less",
    )


def _with_twin(sample: Sample, drawn: Drawn, sensor: Sensor, index: int) -> Sample:
    """Return a sample with its clear twin, where it is in fog."""
    if drawn.scene.fog is None:
        return sample
    return replace(sample, clear=_jpeg(clear_twin(drawn.scene, drawn.view, sensor), _TWIN_JPEG, index))


def _jpeg(image: Image, options: Sequence[int], index: int) -> bytes:
    """Return the content of a picture's file. Raises OutputError."""
    done, data = cv2.imencode(".jpg", image, list(options))
    if not done:
        raise OutputError(f"picture {index} cannot be encoded as JPEG")
    return bytes(data.tobytes())


def _truth(drawn: Drawn, rendered: Rendered) -> Truth:
    """Return what is true of a picture, but for what was applied to it."""
    target, fog, viewpoint = drawn.scene.target, drawn.scene.fog, drawn.viewpoint
    base = Truth(
        drawn.view.camera,
        target is not None,
        height_m=viewpoint.height_m,
        tilt_rad=viewpoint.tilt_rad,
        beta_per_m=fog.beta_per_m if fog else 0.0,
        airlight=fog.airlight if fog else None,
        light=drawn.level,
        ground=drawn.ground,
        carrier=drawn.carrier,
        signs=drawn.signs,
    )
    if target is None:
        return base
    seen = seen_target(target, drawn.view, rendered.hidden)
    camera_T_pad = drawn.view.world_T_camera.inverse() @ target.world_T_pad
    return replace(
        base,
        present=seen.box_px is not None,
        visible_fraction=seen.visible_fraction,
        box_px=seen.box_px,
        camera_T_pad=camera_T_pad,
        tag_corners_px=seen.tag_corners_px,
        size_px=size_px(drawn.view.camera, camera_T_pad, target.pad),
        distance_m=float(np.linalg.norm(camera_T_pad.translation)),
        yaw_rad=viewpoint.yaw_rad,
        hidden=rendered.hidden,
        shadow=rendered.shaded,
    )


def _applied(drawn: Drawn, sensor: Sensor, quality: int) -> tuple[tuple[str, float | str], ...]:
    """Return what else was done to a picture; what is about the print only where there is one."""
    target, view = drawn.scene.target, drawn.view
    sheet = (
        ()
        if target is None
        else (
            ("curled", float(target.sheet.bent)),
            ("dirty", float(target.sheet.dirt is not None)),
            ("gloss", target.sheet.gloss),
            ("occluder", float(bool(target.above))),
        )
    )
    return (
        ("sky", drawn.sky),
        ("scale", drawn.scale),
        ("relief", drawn.scene.relief),
        *sheet,
        ("motion_px", drawn.motion_px),
        ("exposure_s", view.exposure_s),
        ("readout_s", view.readout_s),
        ("psf_sigma_px", sensor.psf_sigma_px),
        ("defocus_radius_px", sensor.defocus_radius_px),
        ("shot_variance", sensor.shot_variance),
        ("read_variance", sensor.read_variance),
        ("bayer", float(sensor.bayer)),
        ("gamma", sensor.gamma),
        ("contrast", sensor.contrast),
        ("saturation", sensor.saturation),
        ("sharpen", sensor.sharpen),
        ("rescale", sensor.rescale),
        ("vignette", sensor.vignette),
        ("jpeg_quality", float(quality)),
    )
