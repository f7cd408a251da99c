"""What reaches the sensor while the shutter is open, and a sensor drawn at random."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from landtool.synth.compose import Linear, Rendered, render
from landtool.synth.domain import Domain, chance, uniform
from landtool.synth.motion_blur import flow_grid, motion_blur
from landtool.synth.scene import Scene
from landtool.synth.sensor import Sensor
from landtool.synth.view import View
from landtool.types import Image


def light_of(scene: Scene, view: View) -> tuple[Linear, Rendered]:
    """Return the light (H, W, 3) float32 on the sensor while the shutter is open, fog and motion in it."""
    rendered = render(scene, view)
    linear = rendered.linear
    if scene.fog is not None:
        eye = view.world_T_camera.translation
        t = scene.fog.transmission(rendered.distance_m, rendered.x_m, rendered.y_m, (float(eye[0]), float(eye[1])))
        scene.fog.apply(linear, t)
    if view.exposure_s > 0.0:
        ground_flow = flow_grid(view, 0.0)
        over = None
        if scene.target is not None and any(scene.target.velocity_mps):
            over = flow_grid(view, float(scene.target.world_T_pad.translation[2]), scene.target.velocity_mps)
        linear = motion_blur(linear, ground_flow, over, rendered.platform)
    return linear, rendered


def clear_twin(scene: Scene, view: View, sensor: Sensor) -> Image:
    """Return the picture (H, W, 3) BGR uint8 of a scene without its fog, by the same camera without its noise."""
    linear, _ = light_of(replace(scene, fog=None), view)
    quiet = replace(sensor, shot_variance=0.0, read_variance=0.0)
    return quiet.picture(linear, np.random.default_rng(0))  # of which nothing is drawn: there is no noise


def random_sensor(domain: Domain, rng: np.random.Generator) -> Sensor:
    """Return a camera's blur, noise and tone; the light of the scene is its exposure already."""
    gains = np.exp(rng.uniform(-domain.white_balance, domain.white_balance, 3))
    saturation, contrast = float(rng.uniform(0.75, 1.25)), float(rng.uniform(-0.1, 0.35))
    gamma = float(np.exp(rng.normal(0.0, 0.08)))
    if not chance(rng, domain.tone):
        saturation, gamma, contrast = 1.0, 1.0, 0.0
    return Sensor(
        white_balance=(float(gains[0]), 1.0, float(gains[2])),
        vignette=uniform(rng, domain.vignette),
        psf_sigma_px=float(rng.uniform(0.2, 0.6)),
        defocus_radius_px=uniform(rng, domain.defocus_px) if chance(rng, domain.defocus) else 0.0,
        shot_variance=uniform(rng, domain.shot_noise) ** 2,
        read_variance=uniform(rng, domain.read_noise) ** 2,
        bayer=chance(rng, domain.bayer),
        saturation=saturation,
        gamma=gamma,
        contrast=contrast,
        sharpen=uniform(rng, domain.sharpen),
        rescale=uniform(rng, domain.rescale) if chance(rng, domain.rescaled) else 1.0,
    )
