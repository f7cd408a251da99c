"""One picture of a data set, from its number alone: a scene drawn at random, rendered, photographed, with its truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from landtool.errors import OutputError
from landtool.geometry import Array, Pose, rotation_from_rotvec
from landtool.pad import PadSpec
from landtool.synth.compose import Rendered, render
from landtool.synth.domain import Domain, chance, log_uniform, uniform
from landtool.synth.mesh import Thing, place
from landtool.synth.motion_blur import flow_grid, motion_blur
from landtool.synth.sample import Sample, Truth
from landtool.synth.scene import Scene, Sun, Target
from landtool.synth.sensor import Sensor
from landtool.synth.sheet import random_sheet
from landtool.synth.surroundings import PHOTOGRAPH, Lot, furnish, random_ground
from landtool.synth.things import CARRIERS, above_pad, drone, pole_shade, tree_shade
from landtool.synth.truth import box_of_rim, rim_m, visible_of_rim
from landtool.synth.view import View
from landtool.synth.viewpoint import Viewpoint, random_camera, random_viewpoint, size_px
from landtool.synth.weather import random_fog, random_weather

_VEHICLES = ("sedan", "suv", "van", "pickup", "flatbed", "trailer", "rover6", "tracked")
_FASTEST_MPS, _FASTEST_RADPS = 4.0, 0.6
# how often a scene is drawn again whose pad is hidden, and how much of what must be in the picture may be
_TRIES, _OF_LEAST = 50, 0.9


def make_sample(
    domain: Domain, pad: PadSpec, size: tuple[int, int], seed: int, index: int, photos: Sequence[Path] = ()
) -> Sample:
    """Return picture `index` of the data set of a seed; size: (width, height) in pixels. The same in any process."""
    rng = np.random.default_rng([seed, index])
    for _ in range(_TRIES):
        scene, viewpoint, view, names = draw_scene(domain, pad, size, photos, rng)
        linear, rendered = light_of(scene, view)
        truth = _truth(scene, viewpoint, view, rendered, names)
        # other bodies may stand before the pad: one that nobody can see is no example of a pad
        if scene.target is None or truth.visible_fraction >= _OF_LEAST * domain.least_visible:
            break
    sensor = random_sensor(domain, rng)
    image = sensor.picture(linear, rng)
    quality = round(uniform(rng, domain.jpeg_quality))
    done, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise OutputError(f"picture {index} cannot be encoded as JPEG")
    return Sample(data.tobytes(), replace(truth, applied=_applied(view, sensor, quality)))


def light_of(scene: Scene, view: View) -> tuple[np.ndarray, Rendered]:
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


def draw_scene(
    domain: Domain, pad: PadSpec, size: tuple[int, int], photos: Sequence[Path], rng: np.random.Generator
) -> tuple[Scene, Viewpoint, View, dict[str, tuple[str, ...]]]:
    """Return a scene, where it is seen from, and the names of what is in it (ground, carrier, signs)."""
    camera = random_camera(domain, *size, rng)
    viewpoint = random_viewpoint(domain, pad, camera, rng)
    present = not chance(rng, domain.absent)
    scale = log_uniform(rng, domain.small_print_scale) if chance(rng, domain.small_print) else 1.0
    carrier_name, carrier, pad_height = _carrier(domain, pad, scale > 1.0, rng)
    heading = float(rng.uniform(-math.pi, math.pi))
    world_T_pad = Pose(rotation_from_rotvec([0.0, 0.0, heading]), np.array([0.0, 0.0, pad_height]))
    view = View.still(camera, world_T_pad @ viewpoint.pad_T_camera)
    floor = random_ground(domain, photos, scale, rng)
    around = furnish(
        domain, pad, Lot(view, _keep_m(carrier, pad), scale), floor, _sign_count(domain, present, rng), rng
    )
    weather = random_weather(domain, rng)
    relief = uniform(rng, domain.relief)
    target = None
    if present:
        target = _target(domain, pad, world_T_pad, carrier, rng)
    scene = Scene(
        around.ground,
        weather.sun,
        target,
        around.regions,
        around.marks,
        around.decals,
        around.things,
        _shades(domain, view, world_T_pad, weather.sun, scale, rng),
        random_fog(domain, weather, float(np.linalg.norm(viewpoint.pad_T_camera.translation)), rng),
        (float(rng.uniform(0.0, 500.0)), float(rng.uniform(0.0, 500.0))),
        1.0 if around.kind == PHOTOGRAPH else relief,
    )
    view = _moving(domain, view, pad_height, rng)
    names = {
        "ground": (around.kind,),
        "carrier": (carrier_name if present else "",),
        "signs": around.signs,
        "weather": (weather.kind, f"{weather.level:.6g}"),
    }
    return scene, viewpoint, view, names


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


def _carrier(domain: Domain, pad: PadSpec, small: bool, rng: np.random.Generator) -> tuple[str, Thing, float]:
    """Return the name of what the pad lies on, its bodies in the pad frame, and the pad's height over the ground."""
    roll = float(rng.random())
    boxes, decks = ("box",), ("table", "boat")
    if small:
        # a small print lies on the ground, on a box or on a table, not on a vehicle of its size
        roll = domain.on_vehicle + roll * (1.0 - domain.on_vehicle)
    names: tuple[str, ...]
    if roll < domain.on_vehicle:
        names = _VEHICLES
    elif roll < domain.on_vehicle + domain.on_box:
        names = boxes
    elif roll < domain.on_vehicle + domain.on_box + domain.on_deck:
        names = decks
    else:
        return "ground", (), float(rng.uniform(0.002, 0.02)) * pad.diameter_m
    name = names[int(rng.integers(len(names)))]
    carrier = CARRIERS[name](rng, pad.extent_m)
    return name, carrier.thing, carrier.pad_height_m


def _keep_m(carrier: Thing, pad: PadSpec) -> float:
    """Return the radius about the pad that other bodies keep out of."""
    reaches = [float(np.hypot(*mesh.points_m[:, :2].T).max()) for mesh in carrier]
    return max([0.75 * pad.extent_m, *reaches])


def _sign_count(domain: Domain, present: bool, rng: np.random.Generator) -> int:
    share = domain.signs_with_pad if present else domain.signs_without_pad
    return int(rng.integers(1, 5)) if chance(rng, share) else 0


def _target(domain: Domain, pad: PadSpec, world_T_pad: Pose, carrier: Thing, rng: np.random.Generator) -> Target:
    sheet = random_sheet(
        rng,
        pad,
        dirtiness=uniform(rng, domain.dirt),
        curled=not carrier and chance(rng, domain.curl),
        glossy=chance(rng, domain.gloss),
    )
    above = above_pad(rng, pad.extent_m) if chance(rng, domain.occlusion) else ()
    return Target(pad, sheet, world_T_pad, carrier, above)


def _shades(
    domain: Domain, view: View, world_T_pad: Pose, sun: Sun, scale: float, rng: np.random.Generator
) -> tuple[Thing, ...]:
    """Return what throws shadows on and about the pad: trees, poles, and the drone itself."""
    shades: list[Thing] = []
    if chance(rng, domain.shadow):
        make = (pole_shade, tree_shade)[int(rng.integers(2))]
        thing = tuple(mesh.stretched(scale) for mesh in make(rng))
        top = max(float(mesh.points_m[:, 2].max()) for mesh in thing)
        pad = world_T_pad.translation
        # the light that passes this high over the ground falls on or near the pad
        high = float(rng.uniform(0.3, 1.0)) * top
        x, y, z = sun.direction
        at = pad[:2] + np.array([x, y]) / max(z, 0.05) * (high - pad[2]) + rng.normal(0.0, 0.4, 2)
        shades.append(place(thing, Pose.from_rotvec([at[0], at[1], 0.0], [0.0, 0.0, float(rng.uniform(-3.1, 3.1))])))
    if chance(rng, domain.drone_shadow):
        above = view.world_T_camera.translation + np.array([0.0, 0.0, 0.08])
        shades.append(place(drone(rng), Pose.from_rotvec(above, [0.0, 0.0, float(rng.uniform(-3.1, 3.1))])))
    return tuple(shades)


def _moving(domain: Domain, view: View, plane_z_m: float, rng: np.random.Generator) -> View:
    """Return the view with the motion that gives the picture the blur and the shear that were drawn."""
    velocity = rng.normal(0.0, 0.5, 3) * _FASTEST_MPS
    rate = rng.normal(0.0, 0.5, 3) * _FASTEST_RADPS
    blurred, rolling = chance(rng, domain.motion_blur), chance(rng, domain.rolling_shutter)
    length_px, shear_px = uniform(rng, domain.motion_blur_px), float(rng.uniform(1.0, 14.0))
    if not (blurred or rolling):
        return view
    second = replace(view, velocity_mps=velocity, rate_radps=rate, exposure_s=1e-3)
    flow = flow_grid(second, plane_z_m)
    px_per_s = 1e3 * float(np.median(np.linalg.norm(flow.reshape(-1, 2), axis=1)))
    exposure = length_px / max(px_per_s, 1.0) if blurred else 0.0
    readout = min(shear_px / max(px_per_s, 1.0), 0.04) if rolling else 0.0
    return replace(second, exposure_s=min(exposure, 0.04), readout_s=readout)


def _truth(
    scene: Scene, viewpoint: Viewpoint, view: View, rendered: Rendered, names: dict[str, tuple[str, ...]]
) -> Truth:
    fog, camera = scene.fog, view.camera
    base = Truth(
        camera,
        scene.target is not None,
        height_m=viewpoint.height_m,
        tilt_rad=viewpoint.tilt_rad,
        beta_per_m=fog.beta_per_m if fog else 0.0,
        airlight=fog.airlight if fog else None,
        light=float(names["weather"][1]),
        ground=names["ground"][0],
        carrier=names["carrier"][0],
        signs=names["signs"],
    )
    if scene.target is None:
        return base
    target = scene.target
    camera_T_pad = view.world_T_camera.inverse() @ target.world_T_pad
    rim = view.project(on_sheet(target, rim_m(target.pad)), target.velocity_mps)
    box = box_of_rim(camera, rim)
    share = visible_of_rim(camera, rim) * (1.0 - rendered.hidden)
    corners = None
    if target.pad.tags:
        corners = view.project(on_sheet(target, target.pad.tag_corners_m(target.pad.tags[0])), target.velocity_mps)
    return replace(
        base,
        present=box is not None,
        visible_fraction=share,
        box_px=box,
        camera_T_pad=camera_T_pad,
        tag_corners_px=corners,
        size_px=size_px(camera, camera_T_pad, target.pad),
        distance_m=float(np.linalg.norm(camera_T_pad.translation)),
        yaw_rad=viewpoint.yaw_rad,
        hidden=rendered.hidden,
        shadow=rendered.shaded,
    )


def on_sheet(target: Target, points_m: Array) -> Array:
    """Return points (N, 3) of the flat pad where the bent sheet has them, in the world."""
    bent = points_m.copy()
    bent[:, 2] += target.sheet.height_m(points_m[:, 0], points_m[:, 1])
    return target.world_T_pad.apply(bent)


def _applied(view: View, sensor: Sensor, quality: int) -> tuple[tuple[str, float | str], ...]:
    return (
        ("exposure_s", view.exposure_s),
        ("readout_s", view.readout_s),
        ("psf_sigma_px", sensor.psf_sigma_px),
        ("defocus_radius_px", sensor.defocus_radius_px),
        ("shot_variance", sensor.shot_variance),
        ("read_variance", sensor.read_variance),
        ("bayer", float(sensor.bayer)),
        ("rescale", sensor.rescale),
        ("vignette", sensor.vignette),
        ("jpeg_quality", float(quality)),
    )
