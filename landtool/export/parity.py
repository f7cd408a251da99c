"""The gate of every export: an ONNX model gives what the network gives that it was made of.

Compared are, over pictures of several shapes and at two sizes of the input:
- the raw numbers of every head, |a - b| / max(1, |b|), at most 1e-4: relative where they are large, because
  two float32 sums of some thousand products differ in proportion to them;
- the scores of every box, at most 1e-4;
- the final boxes after non-maximum suppression, in pixels of the picture, at most 0.1: each has its partner.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import onnx
from numpy.typing import NDArray

from landtool.darknet.forward import decode, halved, joined, raw_heads
from landtool.darknet.network import Network
from landtool.darknet.weights import Floats, Weights
from landtool.detect.decode import channels_first
from landtool.detect.model_file import parse_model
from landtool.detect.nms import suppress
from landtool.detect.preprocess import Placement
from landtool.detect.session import Outputs, Session
from landtool.errors import LandtoolError
from landtool.export.onnx_graph import OUTPUT
from landtool.export.pictures import prepared, smaller_size
from landtool.export.pyramid import HALF, looking
from landtool.geometry import Array
from landtool.types import Image

MOST_RAW, MOST_SCORE, MOST_BOX_PX = 1e-4, 1e-4, 0.1
_CONF, _IOU, _MOST_BOXES = 0.25, 0.45, 300

Forward = Callable[[Floats], Sequence[Floats]]
"""Pictures (1, 3, H, W) to the raw heads (1, anchors * (5 + classes), h, w), in the order of the cfg."""


class ParityError(LandtoolError):
    """An exported model does not give what it should; it is not written."""


@dataclass(frozen=True)
class Parity:
    """How far a model is from a reference, at worst. raw: of the heads, see above. boxes: final ones compared."""

    reference: str
    pictures: int
    raw: float
    score: float
    box_px: float
    boxes: int

    @property
    def is_equal(self) -> bool:
        """Whether nothing is further off than allowed; a NaN is."""
        return self.raw <= MOST_RAW and self.score <= MOST_SCORE and self.box_px <= MOST_BOX_PX


def compare(
    network: Network,
    weights: Weights,
    model: onnx.ModelProto,
    pictures: Iterable[Image],
    others: Mapping[str, Forward] | None = None,
) -> tuple[Parity, ...]:
    """Compare a float32 model that looks once with the network in numpy, and with `others` by their names.

    A network that looks at half size, too, is compared as one that does both.

    Every fourth picture is given at about half the size of the network's input.
    Raises ParityError when one is further off than allowed.
    """
    references: dict[str, Forward] = {"numpy": lambda given: raw_heads(network, weights, given), **(others or {})}
    session = Session(parse_model(looking(_with_heads(model, network), network).SerializeToString()))
    runs: dict[str, list[_Run]] = {name: [] for name in references}
    for index, image in enumerate(pictures):
        small = index % 4 == 3 and session.fixed_size is None
        given, placement = prepared(network, image, smaller_size(network) if small else None)
        outputs = session.run(given)
        for name, reference in references.items():
            heads = [reference(given)]
            if network.pyramid:
                heads.append(reference(halved(network, given)))
            runs[name].append(_run(network, heads, outputs, placement))
    parities = tuple(_parity(name, parts) for name, parts in runs.items())
    for parity in parities:
        if not parity.is_equal:
            raise ParityError(
                f"differs from {parity.reference}: raw {parity.raw:.2g} (at most {MOST_RAW:g}), "
                f"scores {parity.score:.2g} ({MOST_SCORE:g}), boxes {parity.box_px:.2g} px ({MOST_BOX_PX:g})",
                hint="nothing was written; report it with the model",
            )
    return parities


def _with_heads(model: onnx.ModelProto, network: Network) -> onnx.ModelProto:
    """Return the model with the raw heads as outputs behind its own."""
    more = onnx.ModelProto()
    more.CopyFrom(model)
    for index, _ in network.heads:
        name = f"layer{index - 1}"
        more.graph.output.append(onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [None] * 4))
    return more


@dataclass(frozen=True, eq=False)
class _Run:
    """One picture: how far the raw heads are apart, and the decoded output (1, 4 + classes, N) of both."""

    raw: float
    expected: Floats
    given: Floats
    outputs: Outputs
    placement: Placement


def _run(network: Network, looks: Sequence[Sequence[Floats]], outputs: Outputs, placement: Placement) -> _Run:
    """looks: the raw heads of the picture, and of its half where the network looks at that."""
    arrays = dict(zip(outputs.names, outputs.arrays, strict=True))
    raw = 0.0
    for before, heads in zip(("", HALF), looks, strict=False):
        raws = [arrays[f"{before}layer{index - 1}"] for index, _ in network.heads]
        for a, b in zip(raws, heads, strict=True):
            raw = max(raw, _largest(np.abs(a - b) / np.maximum(1.0, np.abs(b))))
    found = [decode(network, heads) for heads in looks]
    return _Run(raw, joined(*found) if network.pyramid else found[0], arrays[OUTPUT], outputs, placement)


def _parity(name: str, runs: Sequence[_Run]) -> Parity:
    # an untrained network is sure of nothing: its best boxes are compared all the same
    conf = min(_CONF, max(float(run.expected[:, 4:].max()) for run in runs) / 2.0)
    farthest, boxes = 0.0, 0
    for run in runs:
        ours, theirs = (_final(values, run, conf) for values in (run.given, run.expected))
        farthest = max(farthest, _farthest(ours, theirs, conf), _farthest(theirs, ours, conf))
        boxes += len(theirs[0])
    score = max(_largest(np.abs(run.expected[:, 4:] - run.given[:, 4:])) for run in runs)
    return Parity(name, len(runs), max(run.raw for run in runs), score, farthest, boxes)


_Final = tuple[Array, Array, NDArray[np.int64]]


def _final(values: Floats, run: _Run, conf: float) -> _Final:
    """Return boxes (N, 4) in pixels of the picture, scores (N,) and classes (N,) after suppression."""
    boxes, scores = channels_first(Outputs((OUTPUT,), (values,), run.outputs.width, run.outputs.height))
    best, kinds = scores.max(axis=1).astype(np.float64), scores.argmax(axis=1)
    good = np.flatnonzero(best >= conf - MOST_SCORE)  # what is just below may be just above on the other side
    kept = good[suppress(boxes[good].astype(np.float64), best[good], kinds[good], iou=_IOU, most=_MOST_BOXES)]
    return run.placement.to_picture(boxes[kept].astype(np.float64)), best[kept], kinds[kept]


def _farthest(ones: _Final, others: _Final, conf: float) -> float:
    """Return how far the edges of a box of `ones` are at most from the nearest of its class, pixels."""
    farthest = 0.0
    for box, score, kind in zip(*ones, strict=True):
        if score >= conf:
            there = others[0][others[2] == kind]
            farthest = max(farthest, _largest(np.abs(there - box).max(axis=1).min(initial=np.inf)))
    return farthest


def _largest(differences: Array | np.floating | float) -> float:
    """Return the largest, infinite where any is no number."""
    largest = float(np.max(differences))
    return largest if np.isfinite(largest) else np.inf
