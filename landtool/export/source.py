"""What is exported: a network, its weights and its classes' names, from a checkpoint or from darknet's own files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from landtool.darknet.cfg import read_cfg
from landtool.darknet.checkpoint import read_checkpoint
from landtool.darknet.data import read_names
from landtool.darknet.network import Network
from landtool.darknet.weights import Weights, read_weights
from landtool.errors import UsageError
from landtool.io.local import local_file


@dataclass(frozen=True, eq=False)
class Trained:
    """A network with weights and the names of its classes. files: those it was read from."""

    network: Network
    weights: Weights
    names: tuple[str, ...]
    files: tuple[Path, ...]


def read_trained(model: Path, cfg: Path | None = None, names: Path | None = None) -> Trained:
    """Read a checkpoint, or a .weights with its cfg, which is the one beside it of the same name unless given.

    names: a .names file; without one a checkpoint's own, or the one beside the .weights of the same name.
    Raises UsageError for what must change on the command line, InputError for a file's content.
    """
    local_file(model)
    if model.suffix != ".weights":
        if cfg is not None:
            raise UsageError("has its own cfg", file=model, hint="leave --cfg out")
        network, weights, own = read_checkpoint(model)
        if names is not None:
            own = read_names(names, network.classes).names
        return Trained(network, weights, own, tuple(path for path in (model, names) if path is not None))
    cfg = cfg or _beside(model, ".cfg", "--cfg")
    network = read_cfg(cfg)
    weights = read_weights(model, network)
    names = names or _beside(model, ".names", "--names")
    return Trained(network, weights, read_names(names, network.classes).names, (model, cfg, names))


def _beside(model: Path, suffix: str, option: str) -> Path:
    path = model.with_suffix(suffix)
    if not path.is_file():
        raise UsageError(f"there is no {path.name} beside it", file=model, hint=f"give it with {option}")
    return path
