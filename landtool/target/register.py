"""The whole print registered to a picture: the pad's pose from every pixel of ring, H, tag and board.

The print is drawn as a camera at a pose would see it, blurred and lit, and compared with the picture in linear light:

    I(u) = min(1, w c(u) + (a X + b Y) (c - d - e)(u) - k d(u) - r e(u) + sum_s g_s (1 - c(u))),
    c, d, e = blur * (coverage, darkness, the ring's darkness)(P(u; T))

P takes a pixel along its ray to the print's plane. Gauss-Newton steps over the pose T, the blur's three variances,
white w with its slope (a, b), black k and the ring r below white and the ground's light g on four sides find the least
weighted squares, with Tukey's weights for what the print does not explain (Lucas and Kanade, 1981; Baker and Matthews,
2004).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from landtool.camera import Camera
from landtool.geometry import Array, Pose, rotvec_from_rotation
from landtool.pad import PadSpec
from landtool.target.patch import Patch, cut_patch, on_print
from landtool.target.print_model import (
    FINE,
    Plane,
    Print,
    blur_kernel,
    correlation,
    limited_blur,
    print_of,
    slopes_of,
    texture_level,
    to_pixels,
)
from landtool.tone import Tone
from landtool.types import Image

_MOST_SIDE_PX = 84.0  # of the board in the patch
_LEAST_PIXELS = 40
_LEAST_COVER = 0.35  # of a pixel by the board, to take part
_STEPS, _LEAST_STEPS = 10, 3  # blur and light need more than one
_STOP = 0.006  # of the pad's radius in the picture: the next step would be several times smaller
_AT_REST = 0.03
_LONGEST_STEP = 0.3
_FIRST_SLACK_PX, _SLACK_PX = 0.6, 0.1  # of edges, in the patch
_FEWEST_STEPS = 2  # of a fit that begins with the last one's blur and light
_TUKEY = 4.5
_ALIKE = 6.0  # how many neighbouring pixels' errors are one, where poses are compared
_REPEATED = 3.0  # ... and of those the weights leave, where a pose is
_LEAST_SCALE = 0.012  # of white: what no model explains
# Light from which on a pixel may be full, the share of such pixels that says white is, and how bright it may be then
_NEAR_FULL, _FULL_SHARE, _OVER, _OVER_SIGMA = 0.93, 0.1, 1.2, 0.4
_DISC = 1.05  # radii, of what counts for the likeness
_BLUR, _BLUR_SIGMA = np.array([0.45, 0.0, 0.45]), 0.5
_LEAST_BLUR, _MOST_BLUR = 0.02, 6.0  # variances, px^2
_FINER = 0.75
_GROUND, _LIGHT_SIGMA, _SLOPE_SIGMA = 0.4, 0.3, 0.3
_N = 18  # pose 6, blur 3, light 9


@dataclass(frozen=True, eq=False)
class Registered:
    """A pad's pose as the whole print gives it.

    covariance: (6, 6) of (dt, dw): t + dt in m, exp(dw) R in rad, both in the camera frame. likeness: correlation of
    the fitted print with the pixels within the ring, in [0, 1]. share: weight of the pixels there that agree. residual:
    robust standard deviation of the pixels about the print, of its contrast. blur_px2: (3,) variances along x, mixed
    and along y, px^2. light: (9,) as the fit's parameters. pixels: that took part. at_rest: whether the last step was
    small.
    """

    camera_T_pad: Pose
    covariance: Array
    likeness: float
    share: float
    residual: float
    blur_px2: Array
    light: Array
    pixels: int
    at_rest: bool

    @property
    def chi2(self) -> float:
        """Minus twice the log likelihood, up to a constant: to compare poses in one picture.

        Pixels are Gaussian about the print: n log(1 - r^2), with n the number of errors that are not one another's.
        """
        return self.pixels / _ALIKE * math.log(1.0 - min(self.likeness, 0.99999) ** 2)

    @property
    def reproj_px(self) -> float:
        """What the residual is as a shift of the print's edges, pixels.

        A brightness error e looks like an edge of width s that is moved by e sqrt(2 pi) s.
        """
        width_px = math.sqrt(max(0.5 * float(self.blur_px2[0] + self.blur_px2[2]), 0.0) + 0.2)
        return self.residual * math.sqrt(2.0 * math.pi) * width_px


def register_target(
    image: Image,
    camera: Camera,
    start: Pose,
    pad: PadSpec,
    tone: Tone = "srgb",
    *,
    turn_known: Array | None = None,
    steps: int = _STEPS,
    most_px: float = _MOST_SIDE_PX,
    before: Registered | None = None,
) -> Registered | None:
    """Register the print near a pose that is off by no more than a tenth of the pad's size.

    None where the print is hardly in the picture, leaves it, or turns its back; and for a pad without ring or board.
    image: (H, W, 3) BGR uint8 of the camera's size. turn_known: (3, 3) inverse covariance, 1/rad^2, of a rotation in
    the camera frame that leads from the start's orientation to the true one, where that was known before; the result
    then knows both. most_px: the board is seen no wider, in a shrunken picture; the smaller, the farther a start may be
    off. before: the same pad's in the last picture, whose blur and light this one begins with.
    """
    what = print_of(pad, tone, in_parts=True)
    if what is None:
        return None
    patch = cut_patch(image, camera, start, pad, tone, most_px)
    return None if patch is None else _Fit(patch, what, pad, start, turn_known).run(steps, before)


def half_turn_odds(image: Image, camera: Camera, found: Registered, pad: PadSpec, tone: Tone = "srgb") -> float | None:
    """Return how much likelier a registered pose is than half a turn from it about the pad's normal, as a log ratio.

    Ring and H look the same, so that nothing has to be fitted again: only the pixels of the tag tell, read or not. None
    where the print is not in the picture.
    """
    what = print_of(pad, tone, in_parts=True)
    patch = None if what is None else cut_patch(image, camera, found.camera_T_pad, pad, tone, _MOST_SIDE_PX)
    if what is None or patch is None:
        return None
    fit = _Fit(patch, what, pad, found.camera_T_pad, None)
    turned = found.camera_T_pad @ Pose(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))
    errors = [fit.errors(pose, found) for pose in (found.camera_T_pad, turned)]
    most = _TUKEY**2
    return float((np.minimum(errors[1], most) - np.minimum(errors[0], most)).sum()) / (2.0 * _ALIKE)


class _Fit:
    """One registration.

    Parameters: pose 6, blur 3, light 9: white and its slopes, black, ring, ground on four sides.
    """

    def __init__(self, patch: Patch, what: Print, pad: PadSpec, start: Pose, turn_known: Array | None) -> None:
        assert pad.ring is not None
        self.start, self.turn_known = start, turn_known
        self.patch, self.what = patch, what
        self.radius_m = pad.ring.outer * pad.diameter_m / 2.0
        self.seen = patch.light.ravel()
        bright = self.seen[self.seen > _NEAR_FULL]
        # white that is as bright as a pixel can be is brighter in truth, and its blur eats the dark beside it
        self.full = float(np.median(bright)) if bright.size > _FULL_SHARE * self.seen.size else math.inf

    def run(self, steps: int, before: Registered | None) -> Registered | None:
        pose, blur, light, least_steps, first_px = self.start, _BLUR.copy(), None, _LEAST_STEPS, _FIRST_SLACK_PX
        if before is not None:
            blur = limited_blur(before.blur_px2 / self.patch.shrink**2, _LEAST_BLUR, _MOST_BLUR)
            light, least_steps = before.light, _FEWEST_STEPS
            first_px = 0.5 * _FIRST_SLACK_PX
        outcome = None
        for done in range(steps):
            plane_z = pose.rotation[:, 2]
            if pose.translation[2] <= 0.0 or plane_z @ pose.translation >= 0.0:
                return None
            slack_px = max(first_px * 0.5**done, _SLACK_PX)
            linear = self._linearise(pose, blur, light, slack_px)
            if linear is None:
                return None
            light = linear.light
            step, moved = linear.step, linear.moved
            shorter = min(1.0, _LONGEST_STEP / moved)
            pose = pose.perturbed(shorter * step[:6])
            blur = limited_blur(blur + shorter * step[6:9], _LEAST_BLUR, _MOST_BLUR)
            light = light + shorter * step[9:]
            outcome = self._outcome(pose, blur, light, linear)
            if moved < _STOP and done + 1 >= least_steps:
                break
        return outcome

    def errors(self, pose: Pose, fitted: Registered) -> Array:
        """Return the squared errors (h w,) of all pixels at a pose lit and blurred as fitted, in their own spread."""
        fine = self._draw(pose, fitted.blur_px2 / self.patch.shrink**2)
        dark, cover, ring = to_pixels(np.ascontiguousarray(fine[1:-1, 1:-1])).reshape(-1, 3).astype(np.float64).T
        x, y = (np.asarray(plane.ravel(), np.float64) for plane in self.patch.middle)
        px, py = on_print((x, y), fitted.camera_T_pad)
        lights = _lights(-py / self.radius_m, -px / self.radius_m, dark, cover, ring)
        model = np.minimum(fitted.light @ lights, self.full)
        scale = max(fitted.residual * float(fitted.light[3]), _LEAST_SCALE * float(fitted.light[0]))
        base = cover**2 / (0.15 + 0.85 * np.clip(model / float(fitted.light[0]), 0.0, 1.2))
        return np.asarray(base * ((self.seen - model) / scale) ** 2)

    def _linearise(self, pose: Pose, blur: Array, light: Array | None, slack_px: float) -> _Linear | None:
        fine = self._draw(pose, blur)
        flat = to_pixels(np.ascontiguousarray(fine[1:-1, 1:-1]))
        index = np.flatnonzero(flat[:, :, 1] > _LEAST_COVER)
        if len(index) < _LEAST_PIXELS:
            return None
        dark, cover, ring = flat.reshape(-1, 3)[index].astype(np.float64).T
        x, y = (np.asarray(plane.ravel()[index], np.float64) for plane in self.patch.middle)
        px, py = on_print((x, y), pose)
        u, v = -py / self.radius_m, -px / self.radius_m
        lights = _lights(u, v, dark, cover, ring)
        seen = self.seen[index].astype(np.float64)
        if light is None:
            light = _first_light(lights, np.where(seen > _NEAR_FULL, _OVER * seen, seen), cover)
        white, black = float(light[0]), float(light[3])
        if not (white > 1e-3 and black > 1e-3):
            return None
        slopes = _slopes(fine, light, index)
        pose_rows = self._moves(pose, x, y, px, py, slopes[:2])
        jacobian = np.concatenate([pose_rows, slopes[2:], lights])
        model = light @ lights
        if self.full < math.inf:
            jacobian = jacobian * (model < self.full)
            model = np.minimum(model, self.full)
        left = seen - model
        base = cover**2 / (0.15 + 0.85 * np.clip(model / white, 0.0, 1.2))
        weighed = np.abs(left) * np.sqrt(base)
        scale = max(1.4826 * float(np.median(weighed)), _LEAST_SCALE * white)
        # an edge is a little off its place, and at first by more: s^2 + (slack |grad I|)^2 is what its pixels may err
        edge = 1.0 + base * (slopes[0] ** 2 + slopes[1] ** 2) * (slack_px / scale) ** 2
        agree = np.maximum(1.0 - base * (left / (_TUKEY * scale)) ** 2 / edge, 0.0) ** 2
        base = base / edge
        weight = base * agree
        weighted = jacobian * weight
        prior, pull = _prior(blur, light)
        if self.full < math.inf:
            prior[9] = (_OVER_SIGMA * self.full) ** -2
            pull[9] = (_OVER * self.full - white) * prior[9]
        information = weighted @ jacobian.T + np.diag(prior) * scale**2
        gradient = weighted @ left + pull * scale**2
        if self.turn_known is not None:
            # in units of the pixels' own information, of which neighbours say the same several times
            known = _REPEATED * scale**2 * self.turn_known
            information[3:6, 3:6] += known
            gradient[3:6] += known @ rotvec_from_rotation(self.start.rotation @ pose.rotation.T)
        step = _solved(information, gradient)
        if step is None:
            return None
        radius_px = self.radius_m * math.sqrt(abs(np.linalg.det(self.patch.px_by_flat))) / float(pose.translation[2])
        motion = self._motion_px(pose, step[:6])
        disc = u**2 + v**2 < _DISC**2
        share = float(weight[disc].sum()) / max(float(base[disc].sum()), 1e-9)
        return _Linear(
            light, step, motion / radius_px, information, scale, share,
            correlation(model[disc], seen[disc]), len(index),
        )  # fmt: skip

    def _draw(self, pose: Pose, blur: Array) -> Plane:
        """Return darkness and coverage (h f + 2, w f + 2, 3)."""
        samples_per_radius = (
            FINE * self.radius_m * math.sqrt(abs(np.linalg.det(self.patch.px_by_flat))) / float(pose.translation[2])
        )
        texture, texel = texture_level(self.what, samples_per_radius, _FINER)
        x, y = on_print(self.patch.fine, pose)
        to_texel = np.float32(-1.0 / (self.radius_m * texel))
        middle = np.float32(len(texture) / 2.0 - 0.5)
        sharp = cv2.remap(
            texture, y * to_texel + middle, x * to_texel + middle, cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT, borderValue=(0, 0, 0),
        )  # fmt: skip
        padded = cv2.copyMakeBorder(sharp, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
        return np.asarray(cv2.filter2D(padded, -1, blur_kernel(blur), borderType=cv2.BORDER_REPLICATE), np.float32)

    def _moves(self, pose: Pose, x: Array, y: Array, px: Array, py: Array, slopes: Array) -> Array:
        """Return how the picture changes (6, N) by a left perturbation (dt, dw) of the pose."""
        # a print moved by d is seen changed by -gradient . d
        ((a, b), (c, d)) = self.patch.px_by_flat
        by_x, by_y = -(slopes[0] * a + slopes[1] * c), -(slopes[0] * b + slopes[1] * d)
        rx, ry = pose.rotation[:, 0], pose.rotation[:, 1]
        qx, qy, qz = (rx[i] * px + ry[i] * py for i in range(3))
        by_z = 1.0 / (qz + pose.translation[2])
        gx, gy = by_x * by_z, by_y * by_z
        gz = -(gx * x + gy * y)
        # g . (dw x q) = dw . (q x g)
        return np.stack([gx, gy, gz, qy * gz - qz * gy, qz * gx - qx * gz, qx * gy - qy * gx])

    def _motion_px(self, pose: Pose, step: Array) -> float:
        """Return how far the ring moves by a step, patch pixels, at the most."""
        angle = np.arange(8) * (np.pi / 4.0)
        rim = self.radius_m * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(8)])
        q = rim @ pose.rotation.T
        seen = q + pose.translation
        moved = seen + step[:3] + np.cross(step[3:], q)
        flat = moved[:, :2] / np.maximum(moved[:, 2:], 1e-6) - seen[:, :2] / seen[:, 2:]
        return float(np.abs(flat @ self.patch.px_by_flat.T).max())

    def _outcome(self, pose: Pose, blur: Array, light: Array, linear: _Linear) -> Registered:
        covariance = np.asarray(np.linalg.inv(linear.information)[:6, :6], np.float64) * (_REPEATED * linear.scale**2)
        return Registered(
            pose, covariance, linear.likeness, linear.share, linear.scale / max(float(light[3]), 1e-3),
            blur * self.patch.shrink**2, light, linear.pixels, linear.moved < _AT_REST,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Linear:
    light: Array
    step: Array
    moved: float
    information: Array
    scale: float
    share: float
    likeness: float
    pixels: int


def _lights(u: Array, v: Array, dark: Array, cover: Array, ring: Array) -> Array:
    """Return how the light adds up (9, N): white, its slopes along u and v, black, ring, ground on four sides."""
    side = np.where(np.abs(u) > np.abs(v), np.where(u > 0.0, 0, 1), np.where(v > 0.0, 2, 3))
    lights = np.zeros((9, len(u)))
    bright = cover - dark - ring
    lights[:5] = cover, bright * u, bright * v, -dark, -ring
    lights[5 + side, np.arange(len(u))] = 1.0 - cover
    return lights


def _first_light(lights: Array, seen: Array, cover: Array) -> Array:
    white = float(np.percentile(seen, 85))
    weights = cover / (0.2 + 0.8 * np.clip(seen / max(white, 1e-6), 0.0, 1.2))
    weak = np.diag([1e-6, 1e3, 1e3, 1e-6, 1e-6, 0.5, 0.5, 0.5, 0.5])  # the slopes wait until the print is in its place
    right = (lights * weights) @ seen
    right[5:] += 0.5 * _GROUND * white
    return np.asarray(np.linalg.solve((lights * weights) @ lights.T + weak, right))


def _slopes(fine: Plane, light: Array, index: NDArray[np.int64]) -> Array:
    """Return how the picture changes (5, N): along x and y, and with the blur's variances along x, mixed, and y."""
    ground = float(light[5:].mean())
    weights = np.array([[-light[3], light[0] - ground, -light[4]]], np.float32)
    return slopes_of(np.asarray(cv2.transform(fine, weights), np.float32))[:, index].astype(np.float64)


def _prior(blur: Array, light: Array) -> tuple[Array, Array]:
    """Return the information (18,) of what is thought before, and its pull (18,) on the step from here."""
    white = float(light[0])
    weak = (_LIGHT_SIGMA * white) ** -2
    prior = np.repeat([0.0, _BLUR_SIGMA**-2, weak, (_SLOPE_SIGMA * white) ** -2, weak], (6, 3, 1, 2, 6))
    prior[9] = prior[12] = prior[13] = 1e-9
    pull = np.zeros(_N)
    pull[6:9] = (_BLUR - blur) * prior[6:9]
    pull[10:12] = -light[1:3] * prior[10:12]
    pull[14:] = (_GROUND * white - light[5:]) * prior[14:]
    return prior, pull


def _solved(information: Array, gradient: Array) -> Array | None:
    """Solve the normal equations, scaled to a unit diagonal as their entries span many decades."""
    d = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information * np.outer(d, d)
    try:
        step = d * np.linalg.solve(scaled + 1e-9 * np.eye(len(d)), d * gradient)
    except np.linalg.LinAlgError:
        return None
    return step if np.isfinite(step).all() else None
