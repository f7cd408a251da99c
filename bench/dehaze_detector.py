"""What the detector and the tag reader see in fog, with dehazing and without."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from bench.dehaze_pairs import clear_set, dehazed_alone, generator_pairs
from bench.detect import SCORED_CONF, on_print
from bench.detect_sets import HEIGHT_M, PAD, SIZE, PictureSet, path_traced_sets
from bench.show import table
from landtool.config import LOOK_THROUGH, TagConfig
from landtool.detect.config import DetectorConfig
from landtool.detect.detector import Detector
from landtool.evaluate.detection import DetectionScore, score_detections
from landtool.io.labels import LabelledBox, LabelledImage
from landtool.run.tags import tag_reader
from landtool.synth.compose import Rendered, render
from landtool.synth.domain import Domain, uniform
from landtool.synth.fog import Fog
from landtool.synth.legible import LEAST_LEGIBLE, legibility
from landtool.synth.photograph import random_sensor
from landtool.synth.random_scene import draw_scene
from landtool.synth.sensor import Sensor
from landtool.synth.truth import seen_target
from landtool.tags.finder import TagFinder
from landtool.types import Detection, Frame, Image

BETAS_PER_M = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3)
SCENES, SEED = 60, 23
# without motion blur, a scene is rendered once for all its fogs
FOG = Domain(
    height_m=(HEIGHT_M, HEIGHT_M), fog=1.0, fog_banks=0.0, small_print=0.0, absent=0.0, motion_blur=0.0
)  # fmt: skip
MODES = ("off", "auto", "on")
CLEAR_SETS = ("path-traced stills", "path-traced clip", "the same, clear")
GOAL = 0.001  # of mAP50, lost in clear air
CONF = DetectorConfig().conf

Boxes = tuple[Detection, ...]


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene in clear air, its fog, the camera it is photographed by, and where its pad is."""

    rendered: Rendered
    fog: Fog
    sensor: Sensor
    jpeg_quality: int
    truth: LabelledImage
    seed: int

    def picture(self, beta_per_m: float) -> Image:
        """Return the picture through even fog; the same noise for every fog."""
        fog = replace(self.fog, beta_per_m=beta_per_m)
        linear = fog.apply(self.rendered.linear.copy(), fog.transmission(self.rendered.distance_m))
        image = self.sensor.picture(linear, np.random.default_rng([SEED, self.seed, 1]))
        data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self.jpeg_quality])[1]
        return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)


@dataclass(frozen=True, eq=False)
class InFog:
    """How well targets are found at one thickness of fog, by mode; opened: share of the pictures the gate opens for."""

    beta_per_m: float
    scores: dict[str, DetectionScore]
    opened: float


@dataclass(frozen=True, eq=False)
class Seen:
    """The detections in a picture without dehazing, with it, and whether the gate opens."""

    off: Boxes
    on: Boxes
    opened: bool

    def boxes(self, mode: str) -> Boxes:
        """Return those of a mode: as in `landtool detect`, those in the original where the dehazed shows none."""
        looks = mode == "on" or (mode == "auto" and self.opened)
        return self.on if looks and any(box.score >= CONF for box in self.on) else self.off


def print_detector() -> None:
    """Print recall and precision in fog and in clear air, and the tags read."""
    rows = []
    for fog in in_fog():
        values = [_cell(getattr(fog.scores[mode], name)) for name in ("recall", "map50") for mode in MODES]
        rows.append([f"{fog.beta_per_m:g}", f"{100.0 * fog.opened:.0f} %", *values])
    head = ["beta, 1/m", "gate open", *(f"{name}, {mode}" for name in ("recall", "mAP50") for mode in MODES)]
    table(f"Shipped detector through fog from {HEIGHT_M:g} m, the same {SCENES} scenes for every beta", head, rows)
    _print_clear()
    _print_tags()


@lru_cache(maxsize=1)
def in_fog() -> Sequence[InFog]:
    """Return how well the shipped detector finds the pads of the same scenes through thicker and thicker fog."""
    look = _Look()
    truth: list[LabelledImage] = []
    seen: list[list[Seen]] = []  # of each scene, through each fog
    for scene in itertools.islice(_scenes(), SCENES):
        truth.append(scene.truth)
        seen.append([look.at(scene.picture(beta)) for beta in BETAS_PER_M])
    made = []
    for beta, through in zip(BETAS_PER_M, zip(*seen, strict=True), strict=True):
        scores = {mode: score_detections(truth, [each.boxes(mode) for each in through]) for mode in MODES}
        made.append(InFog(beta, scores, float(np.mean([each.opened for each in through]))))
    return made


class _Look:
    """The detector as `landtool detect` has it, given the picture as it is and dehazed."""

    def __init__(self) -> None:
        self._find = on_print(Detector(DetectorConfig(conf=SCORED_CONF)))
        self._haze_on = LOOK_THROUGH.haze_on

    def at(self, image: Image, *, only_auto: bool = False) -> Seen:
        """Return what is seen in a picture; only_auto: nothing in the dehazed one where the gate does not open."""
        clear, haze = dehazed_alone(image)
        opened = haze >= self._haze_on
        off = tuple(self._find(image))
        return Seen(off, () if only_auto and not opened else tuple(self._find(clear)), opened)


def _scenes() -> Iterator[Scene]:
    """Yield scenes whose pad can be made out in clear air, without end."""
    for index in itertools.count():
        rng = np.random.default_rng([SEED, index])
        drawn = draw_scene(FOG, PAD, SIZE, (), rng)
        assert drawn.scene.target is not None
        assert drawn.scene.fog is not None
        rendered = render(drawn.scene, drawn.view)
        sensor = random_sensor(FOG, rng)
        seen = seen_target(drawn.scene.target, drawn.view, rendered.hidden)
        shown = sensor.picture(rendered.linear, rng)
        if seen.box_px is None or seen.visible_fraction < FOG.least_visible:
            continue
        if legibility(shown, rendered, PAD) >= LEAST_LEGIBLE:
            x0, y0, x1, y1 = map(float, seen.box_px)
            truth = LabelledImage(Path(f"{index:06d}"), *SIZE, (LabelledBox(0, x0, y0, x1, y1),))
            quality = round(uniform(rng, FOG.jpeg_quality))
            yield Scene(rendered, drawn.scene.fog, sensor, quality, truth, index)


def _print_clear() -> None:
    sets: list[PictureSet] = [clear_set(), *(each for each in path_traced_sets() if each.name in CLEAR_SETS)]
    look = _Look()
    rows = []
    for pictures in sets:
        seen = [look.at(pictures.picture(i), only_auto=True) for i in range(len(pictures.truth))]
        off, auto = (
            score_detections(pictures.truth, [each.boxes(mode) for each in seen], pictures.names)
            for mode in ("off", "auto")
        )
        opened = sum(each.opened for each in seen)
        assert off.map50 is not None
        assert auto.map50 is not None
        values = [f"{off.map50:.4f}", f"{auto.map50:.4f}", f"{auto.map50 - off.map50:+.4f}"]
        rows.append([pictures.name, str(len(seen)), str(opened), *values, _cell(off.recall), _cell(auto.recall)])
    head = ["set", "pictures", "gate open", "mAP50, off", "mAP50, auto", "change", "recall, off", "recall, auto"]
    table(f"Shipped detector in clear air; goal: mAP50 falls by {GOAL:g} at most", head, rows)


def _print_tags() -> None:
    """Print in how many foggy pictures the pad's tag is read, and where it is in the dehazed picture only."""
    pairs = generator_pairs()
    find = Detector(DetectorConfig()).detect
    original, dehazed = 0, 0
    for pair in pairs:
        clear, _ = dehazed_alone(pair.foggy)
        boxes = find(clear)
        if _reads(pair.foggy, boxes):
            original += 1
        elif _reads(clear, boxes):
            dehazed += 1
    in_clear = sum(_reads(pair.clear, ()) for pair in pairs)
    head = ["pairs", "read in the clear twin", "in the foggy picture", "in the dehazed only"]
    table("The pad's tag in the pairs of our generator", head, [[len(pairs), in_clear, original, dehazed]])


def _reads(image: Image, boxes: Boxes) -> bool:
    finder = TagFinder(tag_reader(TagConfig(), PAD), PAD, follow=False)
    return bool(finder.find(Frame(0, None, image), boxes).tags)


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
