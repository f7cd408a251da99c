"""Where the pad's tags are looked for: at an expected pad, in a box, anywhere; and which of them belong to one pad."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from landtool.camera import Camera
from landtool.families import tag_family
from landtool.geometry import Array, Pose
from landtool.pad import PadSpec
from landtool.tags.pose import pad_corners, pad_solutions
from landtool.tags.reader import Region, TagReader
from landtool.tone import Tone
from landtool.types import Image, TagObservation

_LEAST_PX = 10.5  # of a tag's side: smaller ones are never read
_MARGIN_SHARE, _MARGIN_PX = 0.6, 5.0  # about a tag, of its side, and pixels
_BOX_MARGIN = 0.1  # of a box's longer side
_SAME_PLACE = 0.6  # of the pad's radius in the picture


class TagLook:
    """Reads tags where pads are. reader: of the pad's own tags, or more."""

    def __init__(self, reader: TagReader, camera: Camera, pad: PadSpec) -> None:
        self.reader, self._camera, self._pad = reader, camera, pad
        self._ours = {(tag.family, tag.id): tag for tag in pad.tags}
        sizes = [(tag.size, tag.size / tag_family(tag.family).border_modules) for tag in pad.tags]
        self._largest, self._module = max((s for s, _ in sizes), default=0.0), min((m for _, m in sizes), default=0.0)

    def use_tone(self, tone: Tone) -> None:
        """Read on with another tone curve."""
        self.reader = TagReader(replace(self.reader.config, tone=tone))

    def is_readable(self, camera_T_pad: Pose) -> bool:
        """Return whether a pad's largest tag is large enough in the picture to be worth a look."""
        depth = max(float(camera_T_pad.translation[2]), 1e-6)
        return self._camera.fx * self._largest * self._pad.diameter_m / depth >= _LEAST_PX

    def is_legible(self, camera_T_pad: Pose, least_px: float) -> bool:
        """Return whether all of the pad's tags are in the picture, the largest at least so many pixels a side."""
        if not self._pad.tags:
            return False
        seen = self._camera.project(
            camera_T_pad.apply(np.concatenate([self._pad.tag_corners_m(t) for t in self._pad.tags]))
        )
        inside = (seen > 0.0).all() and (seen < np.array([self._camera.width, self._camera.height]) - 1.0).all()
        depth = max(float(camera_T_pad.translation[2]), 1e-6)
        return bool(inside) and self._camera.fx * self._largest * self._pad.diameter_m / depth >= least_px

    def is_readable_in(self, ring_px: float) -> bool:
        """Return the same of a pad whose ring is so wide in the picture."""
        return self._pad.ring is not None and ring_px * self._largest / self._pad.ring.outer >= _LEAST_PX

    def near(self, image: Image, camera_T_pad: Pose, sigma_m: float) -> tuple[TagObservation, ...]:
        """Read the pad's own tags about where it is expected, give or take `sigma_m`."""
        corners = np.concatenate([self._pad.tag_corners_m(tag) for tag in self._pad.tags])
        seen = self._camera.project(camera_T_pad.apply(corners))
        if not np.isfinite(seen).all():
            return ()
        low, high = seen.min(axis=0), seen.max(axis=0)
        scale = self._camera.fx / float(camera_T_pad.translation[2])
        side_px = scale * self._largest * self._pad.diameter_m
        margin = _MARGIN_SHARE * side_px + _MARGIN_PX + 2.0 * sigma_m * scale
        module_px = scale * self._module * self._pad.diameter_m
        return self._read(image, low - margin, high + margin, module_px)

    def in_box(self, image: Image, box_px: Array) -> tuple[TagObservation, ...]:
        """Read the pad's own tags in a box (4,) of its ring's outer circle."""
        if self._pad.ring is None:
            return ()
        sides = box_px[2:] - box_px[:2]
        margin = _BOX_MARGIN * float(sides.max())
        # of a tilted pad the shorter side has the smaller modules; of one cut by the border the longer side tells
        module_px = float(max(sides.min(), 0.6 * sides.max())) * self._module / self._pad.ring.outer
        return self._read(image, box_px[:2] - margin, box_px[2:] + margin, module_px)

    def anywhere(self, image: Image) -> tuple[TagObservation, ...]:
        """Read every tag of the whole picture."""
        return self.reader.read_frame(image)

    def pads_of(self, tags: Sequence[TagObservation]) -> list[tuple[TagObservation, ...]]:
        """Return the pad's own tags in groups, one a pad in the picture, the largest first."""
        groups: list[tuple[Array, float, list[TagObservation]]] = []
        ours = [tag for tag in tags if (tag.family, tag.tag_id) in self._ours]
        if len(ours) < 2:
            return [tuple(ours)] if ours else []
        for tag in sorted(ours, key=lambda t: -float(np.ptp(t.corners_px, axis=0).max())):
            middle, radius = self._pad_px(tag)
            for centre, reach, group in groups:
                other = all((t.family, t.tag_id) != (tag.family, tag.tag_id) for t in group)
                if other and float(np.linalg.norm(centre - middle)) < _SAME_PLACE * reach:
                    group.append(tag)
                    break
            else:
                groups.append((middle, radius, [tag]))
        return [tuple(group) for _, _, group in groups]

    def _pad_px(self, tag: TagObservation) -> tuple[Array, float]:
        """Return where the pad's middle is and how far it reaches, pixels, by one of its tags."""
        spec = self._ours[tag.family, tag.tag_id]
        scale = float(np.ptp(tag.corners_px, axis=0).max()) / spec.size
        corners = pad_corners((tag,), self._camera, self._pad)
        solutions = () if corners is None else pad_solutions(corners)
        if not solutions:
            return tag.corners_px.mean(axis=0), scale / 2.0
        middle = self._camera.project(solutions[0].camera_T_pad.translation[None])[0]
        return middle, scale / 2.0

    def _read(self, image: Image, low: Array, high: Array, module_px: float) -> tuple[TagObservation, ...]:
        height, width = image.shape[:2]
        x0, y0 = np.maximum(np.floor(low), 0).astype(int)
        x1, y1 = np.minimum(np.ceil(high) + 1, [width, height]).astype(int)
        if x1 - x0 < 8 or y1 - y0 < 8 or not module_px > 0.0:
            return ()
        seen = self.reader.read_region(image, Region(int(x0), int(y0), int(x1), int(y1), module_px))
        groups = self.pads_of(seen)
        return groups[0] if groups else ()
