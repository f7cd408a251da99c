"""Export a network: build it, hold it against the original, and write it only when they are equal."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import onnx

from landtool.darknet.cfg import write_cfg
from landtool.darknet.data import NamesFile, names_text, write_names
from landtool.darknet.edit import edited
from landtool.darknet.forward import halved
from landtool.darknet.network import Network
from landtool.darknet.weights import Floats, write_weights
from landtool.errors import InputError, OutputExistsError, UsageError
from landtool.export.accuracy import Accuracy, compare_accuracy
from landtool.export.metadata import described, model_entries
from landtool.export.onnx_graph import build_model
from landtool.export.parity import Forward, Parity, compare
from landtool.export.pictures import prepared, trial_pictures
from landtool.export.pyramid import looking
from landtool.export.quantize import choose_rounding
from landtool.export.rounding import Storage
from landtool.export.source import Trained
from landtool.io.atomic import atomic_path, refuse_input_as_output
from landtool.io.images import SUFFIXES, PictureError, natural_key, read_picture
from landtool.io.labels import YoloDataset, read_yolo

TRIAL_PICTURES = 20
CALIBRATION_PICTURES = 64


@dataclass(frozen=True)
class ExportRequest:
    """What is to be made. size: width and height of the input, none: the cfg's. int8: compute in eight bits.

    calibration: a folder of pictures or a data.yaml whose training pictures they are. val: the data.yaml whose
    validation pictures tell what rounding costs. storage: how the kernels of a float32 network are kept.
    """

    size: tuple[int, int] | None = None
    int8: bool = False
    calibration: Path | None = None
    val: Path | None = None
    storage: Storage = "float32"


@dataclass(frozen=True)
class Exported:
    """What was written, and how equal it is. accuracy: of a rounded model."""

    files: tuple[Path, ...]
    size_bytes: int
    parities: tuple[Parity, ...] = ()
    accuracy: Accuracy | None = None


def write_onnx(
    output: Path,
    trained: Trained,
    request: ExportRequest,
    *,
    overwrite: bool = False,
    others: Mapping[str, Forward] | None = None,
    report: Callable[[str], None] = lambda _text: None,
) -> Exported:
    """Write a network as ONNX.

    others: what else to compare with than the network in numpy, by name. report: told what is being done.

    Raises ParityError when the model does not give what the network gives, or rounding costs too much: nothing is
    written then.
    """
    _refuse(request)
    refuse_input_as_output(trained.files, output)
    trained = _sized(trained, request.size)
    with atomic_path(output, overwrite=overwrite) as temporary:
        network, weights = trained.network, trained.weights
        entries = model_entries(network, trained.names, datetime.now(UTC).date())
        report("comparing with the reference")
        exact = build_model(network, weights)
        parities = compare(network, weights, exact, trial_pictures(TRIAL_PICTURES), others)
        model, accuracy = described(looking(exact, network), entries), None
        if request.int8 or request.storage != "float32":
            report("rounding")
            rounded = described(looking(_rounded(trained, request), network), entries)
            report("measuring what rounding costs")
            truth = _labelled(request)
            if truth.names != trained.names:
                reason = f"its classes are {', '.join(truth.names)}, those of the network {', '.join(trained.names)}"
                raise InputError(reason, file=truth.file, hint="give the dataset it was trained on")
            accuracy = compare_accuracy(model, rounded, truth.read("val"), trained.names)
            model = rounded
        data = model.SerializeToString()
        temporary.write_bytes(data)
    return Exported((output,), len(data), parities, accuracy)


def write_darknet(output: Path, trained: Trained, request: ExportRequest, *, overwrite: bool = False) -> Exported:
    """Write a network as darknet's .weights, with its .cfg and .names beside it."""
    if request.int8 or request.storage != "float32" or request.val or request.calibration:
        raise UsageError("darknet's weights are float32", file=output, hint="write an .onnx, or no rounding")
    files = (output.with_suffix(".cfg"), output.with_suffix(".names"), output)
    for file in files:
        refuse_input_as_output(trained.files, file)
        if file.exists() and not overwrite:
            raise OutputExistsError(file)
    trained = _sized(trained, request.size)
    names = NamesFile(trained.names, names_text(trained.names))
    write_cfg(files[0], trained.network, overwrite=overwrite)
    write_names(files[1], names, overwrite=overwrite)
    write_weights(output, trained.weights, trained.network, overwrite=overwrite)
    return Exported(files, output.stat().st_size)


def _refuse(request: ExportRequest) -> None:
    rounds = request.int8 or request.storage != "float32"
    if request.int8 and request.storage != "float32":
        raise UsageError("an int8 network stores its kernels as int8", hint="leave --storage out")
    if request.int8 and request.calibration is None:
        raise UsageError(
            "--int8 needs pictures to choose its scales by", hint="give a folder or data.yaml with --calibration"
        )
    if request.calibration is not None and not request.int8:
        raise UsageError("--calibration is for --int8 only", hint="leave it out, or add --int8")
    if rounds and request.val is None:
        raise UsageError("rounding needs labelled pictures to tell what it costs", hint="give a data.yaml with --val")
    if request.val is not None and not rounds:
        raise UsageError("--val is for --int8 and --storage only", hint="leave it out")


def _sized(trained: Trained, size: tuple[int, int] | None) -> Trained:
    if size is None:
        return trained
    try:
        return replace(trained, network=edited(trained.network, width=size[0], height=size[1]))
    except InputError as error:  # no file's content but what was typed
        raise UsageError(error.reason, hint=f"give multiples of {trained.network.stride} with --size") from error


def _rounded(trained: Trained, request: ExportRequest) -> onnx.ModelProto:
    network, weights = trained.network, trained.weights
    if request.calibration is None:
        return build_model(network, weights, storage=request.storage)
    files = _spread(_calibration_files(request.calibration))
    return build_model(network, weights, rounding=choose_rounding(network, weights, _looked_at(network, files)))


def _looked_at(network: Network, files: Sequence[Path]) -> Iterator[Floats]:
    """Yield what the network is given of each picture."""
    for file in files:
        given, _ = prepared(network, _picture(file))
        yield given
        if network.pyramid:
            yield halved(network, given)


def _calibration_files(place: Path) -> Sequence[Path]:
    if not place.is_dir():
        return read_yolo(place).splits["train"]
    files = [path for path in place.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file()]
    if not files:
        raise InputError("holds no pictures", file=place, hint="give others with --calibration")
    return sorted(files, key=lambda path: natural_key(path.relative_to(place).as_posix()))


def _spread(files: Sequence[Path]) -> list[Path]:
    """Return some of many files, evenly spread."""
    places = np.linspace(0, len(files) - 1, min(len(files), CALIBRATION_PICTURES))
    return [files[round(place)] for place in places]


def _picture(file: Path) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    try:
        return read_picture(file).image
    except PictureError as error:
        raise InputError(str(error), file=file, hint="replace or remove it") from error


def _labelled(request: ExportRequest) -> YoloDataset:
    assert request.val is not None  # refused before
    return read_yolo(request.val)
