"""Time of the detector a frame against a bare run of the same network, and against OpenCV's dnn."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import onnxruntime
from numpy.typing import NDArray

from bench.detect_sets import FIXTURES
from bench.show import table
from landtool.detect.config import DetectorConfig
from landtool.detect.detector import SHIPPED_MODEL, Detector
from landtool.detect.search import DetectorSearch
from landtool.detect.stage import DetectStage
from landtool.geometry import Array
from landtool.io.source import open_source
from landtool.pad import PadSpec
from landtool.types import Detection, Frame, Image

CLIP = FIXTURES / "approach.mp4"
ROUNDS = 5
BARE = "bare run"

Tensor = NDArray[Any]


@dataclass(frozen=True)
class Network:
    """A network to be measured; path None: that of the package."""

    name: str
    path: Path | None

    @property
    def file(self) -> Path:
        """Where it is."""
        return self.path or Path(str(resources.files("landtool"))) / "models" / SHIPPED_MODEL


class Followed:
    """The region mode of `landtool detect`: it looks around a target it holds. Given the frames of one clip in order.

    conf: least score of a box that is followed, whatever else the detector gives.
    """

    def __init__(self, detector: Detector, conf: float = DetectorConfig.conf) -> None:
        self._detector, self._conf = detector, conf
        self.begin()

    def begin(self) -> None:
        """Start a clip."""
        self._search, self._frame = DetectorSearch(), 0

    def detect(self, image: Image) -> tuple[Detection, ...]:
        """Return what is in the next frame, or in a part of it."""
        region = self._search.next_region(self._frame, image.shape[1], image.shape[0])
        found = self._detector.detect(image) if region is None else self._detector.detect_region(image, region)
        self._search.saw(self._frame, [box for box in found if box.score >= self._conf])
        self._frame += 1
        return found


@dataclass(frozen=True, eq=False)
class Way:
    """One way to run a network on a frame and its tensor. begin: called before each pass over the clip."""

    network: str
    name: str
    call: Callable[[Image, Tensor], object]
    begin: Callable[[], None] = lambda: None


def print_speed(networks: Sequence[Network]) -> None:
    """Print the wall time a frame of every way to run every network; the first network's bare run is the measure."""
    ways = [way for network in networks for way in _ways(network)]
    frames = [frame.image for frame in open_source(CLIP) if isinstance(frame, Frame)]
    size = Detector(DetectorConfig(model=networks[0].path)).imgsz
    best_ms = _timed(ways, frames, size)
    bare_ms = {way.network: times for way, times in zip(ways, best_ms, strict=True) if way.name == BARE}
    rows = []
    for way, times in zip(ways, best_ms, strict=True):
        own, first = bare_ms[way.network].mean(), bare_ms[networks[0].name].mean()
        values = (f"{times.mean():.2f}", f"{np.median(times):.2f}", f"{times.mean() / own:.3f}")
        rows.append([way.network, way.name, *values, f"{first / times.mean():.2f}"])
    said = f"{CLIP.name}, {len(frames)} frames, input {size[0]}x{size[1]}, one thread: wall time a frame, ms"
    head = ["network", "way", "mean", "median", "of its bare run", f"times faster than {networks[0].name} bare"]
    table(f"{said}; the best of {ROUNDS} rounds, interleaved", head, rows)


def _ways(network: Network) -> list[Way]:
    detector, followed = (Detector(DetectorConfig(model=network.path)) for _ in range(2))
    session = _bare_session(network.file)
    name = session.get_inputs()[0].name
    regions = Followed(followed)
    stage = DetectStage(detector, ring_of=PadSpec())
    ways = [
        Way(network.name, BARE, lambda _, tensor: session.run(None, {name: tensor})),
        Way(network.name, "Detector", lambda image, _: detector.detect(image)),
        Way(network.name, "Detector and print", lambda image, _: stage.find(Frame(0, None, image))),
        Way(network.name, "Detector, regions", lambda image, _: regions.detect(image), regions.begin),
    ]
    net = _opencv_net(network.file, detector.imgsz)
    if net is not None:
        ways.append(Way(network.name, "cv2.dnn, bare", lambda _, tensor: _forward(net, tensor)))
    return ways


def _timed(ways: Sequence[Way], frames: Sequence[Image], size: tuple[int, int]) -> Array:
    """Return the best time (ways, frames) of every frame over the rounds, ms; one round more warms up."""
    best = np.full((len(ways), len(frames)), np.inf)
    for turn in range(ROUNDS + 1):
        for way in ways:
            way.begin()
        for i, image in enumerate(frames):
            tensor = cv2.dnn.blobFromImage(image, 1.0 / 255.0, size, swapRB=True)
            # each way follows each other one in turn, so that none finds the caches always the same
            for k in range(len(ways)):
                at = (k + turn + i) % len(ways)
                start = time.perf_counter()
                ways[at].call(image, tensor)
                spent_ms = 1e3 * (time.perf_counter() - start)
                if turn:
                    best[at, i] = min(best[at, i], spent_ms)
    return best


def _bare_session(file: Path) -> onnxruntime.InferenceSession:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])


def _opencv_net(file: Path, size: tuple[int, int]) -> cv2.dnn.Net | None:
    """Return the network in OpenCV's dnn; None for one it cannot run."""
    try:
        net = cv2.dnn.readNetFromONNX(str(file))
        _forward(net, np.zeros((1, 3, size[1], size[0]), np.float32))
    except cv2.error as error:
        print(f"\ncv2.dnn refuses {file.name}: {str(error).strip().splitlines()[-1][:120]}")
        return None
    return net


def _forward(net: cv2.dnn.Net, tensor: Tensor) -> None:
    net.setInput(tensor)
    net.forward()
