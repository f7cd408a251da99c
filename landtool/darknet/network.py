"""A network as a darknet cfg describes it: typed layers, each with the shape of what it gives out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Activation = Literal["leaky", "linear"]


@dataclass(frozen=True)
class Shape:
    """What a layer gives out: channels, and how many input pixels one of its cells stands for, across and down."""

    channels: int
    stride: int


@dataclass(frozen=True)
class Convolutional:
    """A convolution over `channels` maps, padded by half its size, then batch norm if there is one, then activation."""

    out: Shape
    channels: int
    size: int
    stride: int
    padding: int
    batch_normalize: bool
    activation: Activation
    line: int = 0

    @property
    def filters(self) -> int:
        """Number of kernels."""
        return self.out.channels

    @property
    def parameters(self) -> int:
        """Numbers a weights file holds for this layer: kernels, and biases or the four of batch norm."""
        return self.filters * (self.channels * self.size**2 + (4 if self.batch_normalize else 1))


@dataclass(frozen=True)
class MaxPool:
    """The greatest value of each window; darknet pads `size - 1` cells, the larger half right and below."""

    out: Shape
    size: int
    stride: int
    line: int = 0

    @property
    def padding(self) -> tuple[int, int]:
        """Cells added left and above, and right and below."""
        before = (self.size - 1) // 2
        return before, self.size - 1 - before


@dataclass(frozen=True)
class Upsample:
    """Each cell repeated `factor` times across and down."""

    out: Shape
    factor: int
    line: int = 0


@dataclass(frozen=True)
class Route:
    """The maps of earlier layers, by absolute index, one after the other."""

    out: Shape
    layers: tuple[int, ...]
    line: int = 0


@dataclass(frozen=True)
class Yolo:
    """A detection head over the maps before it: 5 + classes of them an anchor.

    anchors: (width, height) in input pixels, those of this head only. scale_xy: how far a centre can leave its cell,
    darknet's scale_x_y. ignore_iou: a box without a target that overlaps one by more is no error.
    positive_iou: anchors that overlap a target by more learn it too; 1: the best one only (darknet's iou_thresh).
    """

    out: Shape
    classes: int
    anchors: tuple[tuple[float, float], ...]
    scale_xy: float = 1.0
    ignore_iou: float = 0.5
    positive_iou: float = 1.0
    line: int = 0


Layer = Convolutional | MaxPool | Upsample | Route | Yolo


@dataclass(frozen=True)
class Training:
    """What the [net] section says of training.

    batch: pictures a step, learned in `subdivisions` parts. hue: share of the colour circle. saturation, exposure:
    most by which they are multiplied or divided. angle_deg: most by which pictures are turned; refused when not 0.
    steps: iterations after which the rate is multiplied by `scales`. burn_in: iterations of warm-up.
    """

    batch: int = 32
    subdivisions: int = 8
    learning_rate: float = 0.001
    momentum: float = 0.9
    decay: float = 0.0005
    burn_in: int = 1000
    max_batches: int = 500200
    steps: tuple[int, ...] = (400000, 450000)
    scales: tuple[float, ...] = (0.1, 0.1)
    angle_deg: float = 0.0
    hue: float = 0.1
    saturation: float = 1.5
    exposure: float = 1.5


@dataclass(frozen=True)
class Network:
    """A network that takes RGB pictures in [0, 1] of `width` x `height` pixels.

    letterbox: whether pictures keep their shape, with borders, or are stretched. pyramid: whether it looks at a picture
    twice, in full and in half size, as its deepest cells see no more than about 320 pixels: landtool's own key, which
    darknet passes over. text: the cfg it was read from.
    """

    width: int
    height: int
    channels: int
    layers: tuple[Layer, ...]
    letterbox: bool = False
    pyramid: bool = False
    training: Training = field(default_factory=Training)
    text: str = ""

    @property
    def heads(self) -> tuple[tuple[int, Yolo], ...]:
        """The detection heads with their layers' indices, in the order of the cfg."""
        return tuple((i, layer) for i, layer in enumerate(self.layers) if isinstance(layer, Yolo))

    @property
    def convolutions(self) -> tuple[tuple[int, Convolutional], ...]:
        """The layers that have weights, with their indices."""
        return tuple((i, layer) for i, layer in enumerate(self.layers) if isinstance(layer, Convolutional))

    @property
    def classes(self) -> int:
        """Number of classes, the same for every head."""
        return self.heads[0][1].classes

    @property
    def stride(self) -> int:
        """Input pixels a cell of the coarsest layer stands for; width and height must be multiples."""
        return max(layer.out.stride for layer in self.layers)

    def half_size(self, width: int, height: int) -> tuple[int, int]:
        """Return the size of the second look at an input: half of it, filled up to whole cells right and below."""
        return tuple(-(-(side // 2) // self.stride) * self.stride for side in (width, height))  # type: ignore[return-value]

    @property
    def parameters(self) -> int:
        """Numbers a complete weights file holds."""
        return sum(layer.parameters for _, layer in self.convolutions)
