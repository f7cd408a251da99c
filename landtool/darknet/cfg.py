"""Read a darknet .cfg: sections of `key=value` lines, one section a layer, checked line by line.

What landtool's networks consist of is known here; any other section or key that changes the result is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from landtool.darknet.network import Convolutional, Layer, MaxPool, Network, Route, Shape, Training, Upsample, Yolo
from landtool.darknet.section import HINT, Section, line_error, sections
from landtool.errors import InputError, UsageError
from landtool.io.atomic import atomic_path
from landtool.io.local import local_file

_MOST_BYTES = 1 << 20  # a cfg is a few kilobytes of text
_MOST_FILTERS = 8192
_MOST_PARAMETERS = 1 << 28  # a gigabyte of weights
_MOST_SIDE = 4096
_MOST_LAYERS = 512


def read_cfg(path: Path) -> Network:
    """Read a network. Raises UsageError when the file cannot be opened, InputError naming the line of what is wrong."""
    try:
        with local_file(path).open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise UsageError(error.strerror or "cannot be read", file=path, hint=HINT) from error
    try:
        if len(data) > _MOST_BYTES:
            raise InputError("is far too long for a cfg", hint=HINT)
        return parse_cfg(data.decode())
    except UnicodeDecodeError as error:
        raise InputError("is no text", file=path, hint=HINT) from error
    except InputError as error:
        raise InputError(error.reason, file=path, hint=error.hint) from error


def write_cfg(path: Path, network: Network, *, overwrite: bool = False) -> None:
    """Write the text a network was read from, byte for byte. Raises OutputError, OutputExistsError."""
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(network.text.encode())


def parse_cfg(text: str) -> Network:
    """Return the network a cfg's text describes. Raises InputError naming the line of what is wrong."""
    parts = list(sections(text))
    if not parts or parts[0].name not in ("net", "network"):
        raise line_error(parts[0].line if parts else 1, "does not begin with [net]")
    net = parts[0]
    width = net.whole("width", None, 32, _MOST_SIDE)
    height = net.whole("height", None, 32, _MOST_SIDE)
    net.only("channels", "3", "3")
    layers: list[Layer] = []
    if len(parts) > _MOST_LAYERS:
        raise line_error(parts[_MOST_LAYERS].line, "more layers than any network of this kind has")
    for section in parts[1:]:
        if section.name not in _LAYERS:
            known = ", ".join(_LAYERS)
            raise line_error(section.line, f"[{section.name}] is not supported", f"known are {known}")
        layers.append(_LAYERS[section.name](section, layers))
        section.refuse_rest(_HARMLESS[section.name])
    network = Network(
        width, height, 3, tuple(layers), net.flag("letter_box"), net.flag("pyramid"), _training(net), text
    )
    net.refuse_rest(_HARMLESS["net"])
    _check(network)
    return network


def _training(net: Section) -> Training:
    plain = Training()
    net.only("policy", "steps", "steps")
    steps, scales = net.whole_numbers("steps", "400000,450000"), net.numbers("scales", ".1,.1")
    if len(steps) != len(scales):
        raise line_error(net.line_of("scales"), f"{len(scales)} scales for {len(steps)} steps")
    net.only("angle", "0", "0")
    return Training(
        batch=net.whole("batch", plain.batch, 1, 1 << 16),
        subdivisions=net.whole("subdivisions", plain.subdivisions, 1, 1 << 16),
        learning_rate=net.number("learning_rate", plain.learning_rate, 0.0, 10.0),
        momentum=net.number("momentum", plain.momentum, 0.0, 1.0),
        decay=net.number("decay", plain.decay, 0.0, 1.0),
        burn_in=net.whole("burn_in", plain.burn_in, 0, 1 << 30),
        max_batches=net.whole("max_batches", plain.max_batches, 1, 1 << 30),
        steps=steps,
        scales=scales,
        hue=net.number("hue", plain.hue, 0.0, 0.5),
        saturation=net.number("saturation", plain.saturation, 1.0, 10.0),
        exposure=net.number("exposure", plain.exposure, 1.0, 10.0),
    )


def _convolutional(section: Section, before: list[Layer]) -> Convolutional:
    given = _shape(before)
    size = section.whole("size", 1, 1, 11)
    stride = section.whole("stride", 1, 1, 8)
    padding = size // 2 if section.flag("pad") else section.whole("padding", 0, 0, 11)
    if 2 * padding != size - 1:
        raise line_error(
            section.line, "the size of the picture would change by more than the stride", "pad by half of size"
        )
    section.only("groups", "1", "1")
    section.only("dilation", "1", "1")
    activation = section.text("activation", "linear")
    if activation not in ("leaky", "linear"):
        reason = f"activation '{activation}' is not supported"
        raise line_error(section.line_of("activation"), reason, "known are leaky, linear")
    filters = section.whole("filters", 1, 1, _MOST_FILTERS)
    out = Shape(filters, given.stride * stride)
    batch_normalize = section.flag("batch_normalize")
    known: Any = activation
    return Convolutional(out, given.channels, size, stride, padding, batch_normalize, known, section.line)


def _maxpool(section: Section, before: list[Layer]) -> MaxPool:
    given = _shape(before)
    stride = section.whole("stride", 1, 1, 8)
    size = section.whole("size", stride, 1, 16)
    section.only("padding", str(size - 1), str(size - 1))
    return MaxPool(Shape(given.channels, given.stride * stride), size, stride, section.line)


def _upsample(section: Section, before: list[Layer]) -> Upsample:
    given = _shape(before)
    factor = section.whole("stride", 2, 2, 8)
    if given.stride % factor:
        raise line_error(section.line, "enlarges beyond the picture")
    return Upsample(Shape(given.channels, given.stride // factor), factor, section.line)


def _route(section: Section, before: list[Layer]) -> Route:
    line = section.line_of("layers")
    indices: list[int] = []
    for index in section.whole_numbers("layers"):
        absolute = index if index >= 0 else len(before) + index
        if not 0 <= absolute < len(before):
            raise line_error(line, f"layer {index} is not one before this", f"this is layer {len(before)}")
        if isinstance(before[absolute], Yolo):
            raise line_error(line, f"layer {index} is a detection head")
        indices.append(absolute)
    section.only("groups", "1", "1")
    if not indices:
        raise line_error(line, "names no layer")
    shapes = [before[index].out for index in indices]
    if len({shape.stride for shape in shapes}) > 1:
        raise line_error(line, "joins layers of different size")
    return Route(Shape(sum(shape.channels for shape in shapes), shapes[0].stride), tuple(indices), section.line)


def _yolo(section: Section, before: list[Layer]) -> Yolo:
    given = _shape(before)
    classes = section.whole("classes", 20, 1, 10000)
    numbers = section.numbers("anchors")
    pairs = tuple(zip(numbers[::2], numbers[1::2], strict=False))
    line = section.line_of("anchors")
    if len(numbers) % 2 or not pairs or not all(0.0 < v < 1e5 for v in numbers):
        raise line_error(line, "anchors must be pairs of widths and heights in pixels")
    if section.whole("num", len(pairs), 1, 1000) != len(pairs):
        raise line_error(section.line_of("num"), f"num = {section.text('num')}, but there are {len(pairs)} anchors")
    mask = section.whole_numbers("mask", ",".join(map(str, range(len(pairs)))))
    if not mask or not all(0 <= index < len(pairs) for index in mask) or len(set(mask)) != len(mask):
        raise line_error(section.line_of("mask"), "mask must name anchors, counted from 0")
    wanted = len(mask) * (classes + 5)
    conv = before[-1] if before else None
    if not isinstance(conv, Convolutional) or conv.filters != wanted:
        raise line_error(
            conv.line if conv else section.line, f"{given.channels} filters before [yolo] where {wanted} belong"
        )
    if conv.batch_normalize or conv.activation != "linear":
        raise line_error(conv.line, "the convolution before [yolo] must be linear, without batch_normalize")
    section.only("new_coords", "0", "0")
    return Yolo(
        Shape(wanted, given.stride),
        classes,
        tuple(pairs[index] for index in mask),
        section.number("scale_x_y", 1.0, 1.0, 2.0),
        section.number("ignore_thresh", 0.5, 0.0, 1.0),
        section.number("iou_thresh", 1.0, 0.0, 1.0),
        section.line,
    )


# Every layer a cfg may hold, and what reads it
_LAYERS: dict[str, Callable[[Section, list[Layer]], Layer]] = {
    "convolutional": _convolutional,
    "maxpool": _maxpool,
    "upsample": _upsample,
    "route": _route,
    "yolo": _yolo,
}

# Keys that only darknet's own training or drawing reads
_NET_KEYS = """
    policy inputs max_chart_loss mosaic_bound cutmix mosaic flip blur gaussian_noise use_cuda_graph
    optimized_memory workspace_size_limit_MB time_steps random log_step burnin_power power max_crop
    min_crop
"""
_YOLO_KEYS = """
    jitter truth_thresh random resize cls_normalizer iou_normalizer obj_normalizer delta_normalizer
    iou_loss iou_thresh_kind nms_kind beta_nms max map focal_loss max_delta label_smooth_eps
    show_details
"""
_HARMLESS = {
    "net": frozenset(_NET_KEYS.split()),
    "convolutional": frozenset(("stopbackward", "dontload", "dontloadscales", "learning_rate")),
    "maxpool": frozenset(("stopbackward",)),
    "upsample": frozenset(),
    "route": frozenset(("stopbackward",)),
    "yolo": frozenset(_YOLO_KEYS.split()),
}


def _shape(before: list[Layer]) -> Shape:
    if before and isinstance(before[-1], Yolo):
        raise line_error(before[-1].line, "a layer takes what a detection head gives out", "begin with [route]")
    return before[-1].out if before else Shape(3, 1)


def _check(network: Network) -> None:
    heads = network.heads
    if not heads:
        raise InputError("has no [yolo] section", hint=HINT)
    if len({head.classes for _, head in heads}) > 1:
        raise line_error(heads[-1][1].line, "the heads differ in their number of classes")
    if network.parameters > _MOST_PARAMETERS:
        raise InputError(f"describes a network of {network.parameters} weights", hint="that is no network of this kind")
    for side, value in (("width", network.width), ("height", network.height)):
        if value % network.stride:
            raise InputError(f"{side} = {value} is no multiple of {network.stride}, the network's stride")
