"""A clip before it is a file: everything drawn, and each picture with its truth at its time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from landtool.camera import Camera
from landtool.geometry import Array, Pose
from landtool.synth.clips.config import ClipConfig
from landtool.synth.clips.ego import EgoErrors, Odometry
from landtool.synth.clips.flight import Flight
from landtool.synth.clips.guidance import fly
from landtool.synth.clips.platform import PlatformMotion
from landtool.synth.clips.scenarios import SCENARIOS
from landtool.synth.clips.scenery import DOMAIN, Body, ClipScene, clip_scene, draw_body
from landtool.synth.clips.times import frame_times_ns
from landtool.synth.photograph import light_of, random_sensor
from landtool.synth.scene import Target
from landtool.synth.sensor import Sensor
from landtool.synth.truth import seen_target
from landtool.synth.view import View
from landtool.synth.viewpoint import random_camera
from landtool.types import Image

_EXPOSURE_S, _READOUT_S = (0.001, 0.006), (0.004, 0.018)
_HIDDEN = 0.5  # share of the disc from which on it counts as occluded


@dataclass(frozen=True, eq=False)
class FrameTruth:
    """What is true of one picture; poses at the middle of the exposure of its middle row.

    pad_velocity_mps: (3,) in the world. visible_fraction: share of the disc inside the ring's outer circle that is in
    the picture and not hidden. hidden: share of the part in the picture that something hides. box_px: (4,) as
    `box_of_rim`, None where the picture holds none of it, hidden or not. tag_corners_px: (4, 2) upright top-left,
    top-right, bottom-right, bottom-left, in the picture or not; None for a pad without a tag.
    """

    index: int
    t_ns: int
    world_T_body: Pose
    world_T_camera: Pose
    world_T_pad: Pose
    pad_velocity_mps: Array
    visible_fraction: float
    hidden: float
    box_px: Array | None
    tag_corners_px: Array | None

    @property
    def camera_T_pad(self) -> Pose:
        """The pad in the camera frame."""
        return self.world_T_camera.inverse() @ self.world_T_pad

    @property
    def occluded(self) -> bool:
        """Whether most of the part in the picture is hidden."""
        return self.hidden > _HIDDEN


@dataclass(frozen=True, eq=False)
class Take:
    """A clip that can be photographed. exposure_s, readout_s: as of `View`."""

    config: ClipConfig
    camera: Camera
    motion: PlatformMotion
    flight: Flight
    body: Body
    scene: ClipScene
    sensor: Sensor
    errors: EgoErrors
    times_ns: tuple[int, ...]
    exposure_s: float
    readout_s: float
    noise: np.random.SeedSequence

    def frames(self) -> Iterator[tuple[Image, FrameTruth]]:
        """Yield every picture (H, W, 3) BGR uint8 and its truth."""
        rng = np.random.default_rng(self.noise)
        for index, t_ns in enumerate(self.times_ns):
            view = self.view(t_ns / 1e9)
            scene = self.scene.at(t_ns / 1e9)
            linear, rendered = light_of(scene, view)
            image = self.sensor.picture(linear, rng)
            assert scene.target is not None
            yield image, self._truth(index, view, scene.target, rendered.hidden)

    def view(self, t_s: float) -> View:
        """Return the camera at a time, with its motion."""
        world_T_body, mount = self.flight.world_T_body(t_s), self.config.body_T_camera
        rate = self.flight.rate_radps(t_s)
        # a camera aside of the body's centre is swung about it: v + w x r
        swing = world_T_body.rotation @ np.cross(rate, mount.translation)
        return View(
            self.camera,
            world_T_body @ mount,
            self.flight.velocity_mps(t_s) + swing,
            mount.rotation.T @ rate,
            self.exposure_s,
            self.readout_s,
        )

    def odometry(self, t_ns: int) -> Odometry:
        """Return what the drone says of itself at a time."""
        return self.errors.odometry(self.flight, t_ns)

    def _truth(self, index: int, view: View, target: Target, hidden: float) -> FrameTruth:
        t_ns = self.times_ns[index]
        seen = seen_target(target, view, hidden)
        return FrameTruth(
            index,
            t_ns,
            self.flight.world_T_body(t_ns / 1e9),
            view.world_T_camera,
            target.world_T_pad,
            np.array(target.velocity_mps),
            seen.visible_fraction,
            hidden,
            seen.box_px,
            seen.tag_corners_px,
        )


def draw_take(config: ClipConfig) -> Take:
    """Return the clip of a request; every part has randomness of its own, so that a switch changes only its part.

    Raises UsageError when an occlusion does not fit between drone and platform.
    """
    *seeds, noise = np.random.SeedSequence(config.seed).spawn(8)
    body_rng, motion_rng, flight_rng, camera_rng, scene_rng, time_rng, ego_rng = map(np.random.default_rng, seeds)
    body = draw_body(config.scenario, config.pad, body_rng)
    motion = SCENARIOS[config.scenario](motion_rng, config.duration_s, body.height_m)
    flight = fly(motion, config.approach, flight_rng)
    camera = config.camera or _camera(config, camera_rng)
    sensor = random_sensor(DOMAIN, camera_rng)
    exposure_s, readout_s = (math.exp(camera_rng.uniform(*np.log(r))) for r in (_EXPOSURE_S, _READOUT_S))
    period_s = float(1 / config.fps)
    times_ns = frame_times_ns(config.fps, config.duration_s, time_rng if config.vfr else None)
    return Take(
        config,
        camera,
        motion,
        flight,
        body,
        clip_scene(scene_rng, config, motion, flight, body),
        sensor,
        EgoErrors.drawn(times_ns[-1], ego_rng),
        tuple(times_ns),
        # a row is read before it is exposed again
        min(exposure_s, 0.2 * period_s),
        min(readout_s, 0.7 * period_s),
        noise,
    )


def _camera(config: ClipConfig, rng: np.random.Generator) -> Camera:
    domain = replace(DOMAIN, hfov_deg=(config.hfov_deg, config.hfov_deg), distortion=1.0, distortion_k1=(-0.2, -0.02))
    return random_camera(domain, *config.size, rng)
