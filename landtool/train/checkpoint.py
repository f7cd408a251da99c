"""A training's state in one file, so that it can go on as if it had never stopped.

The file is landtool.darknet.checkpoint's .npz: the averaged network, ready to be exported, and beside it all that the
next step depends on. Nothing in it is pickled.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from landtool.darknet.checkpoint import checkpoint_arrays, read_checkpoint
from landtool.darknet.weights import Weights, parse_weights, weights_bytes
from landtool.errors import InputError
from landtool.io.atomic import atomic_path
from landtool.train.step import Learner

_HINT = "give another -o, or --overwrite to begin anew"


@dataclass(frozen=True)
class Progress:
    """How far a training is. iteration: steps taken. seconds: spent on them. best: the highest score so far.

    losses: sums of box, objectness and class loss since the last row of results, of `steps` steps.
    """

    iteration: int = 0
    seconds: float = 0.0
    best: float = -1.0
    losses: tuple[float, float, float] = (0.0, 0.0, 0.0)
    steps: int = 0


def save_weights(path: Path, learner: Learner, names: tuple[str, ...], iteration: int) -> None:
    """Write the averaged network alone, replacing what is there. Raises OutputError."""
    arrays = checkpoint_arrays(learner.network, _averaged(learner, iteration), names)
    with atomic_path(path, overwrite=True) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def save_state(path: Path, learner: Learner, names: tuple[str, ...], progress: Progress) -> None:
    """Write all that the next step depends on, replacing what is there. Raises OutputError."""
    arrays: dict[str, NDArray[np.generic]] = checkpoint_arrays(
        learner.network, _averaged(learner, progress.iteration), names
    )
    arrays["progress"] = np.frombuffer(json.dumps(asdict(progress)).encode(), np.uint8)
    arrays["model"] = np.frombuffer(weights_bytes(learner.model.weights(), learner.network), np.uint8)
    for index, state in learner.optimizer.state_dict()["state"].items():
        for key, value in state.items():
            arrays[f"optimizer/{index}/{key}"] = torch.as_tensor(value).contiguous().numpy()
    with atomic_path(path, overwrite=True) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def load_state(path: Path, learner: Learner) -> Progress:
    """Put a saved state into a learner of the same network. Raises InputError when it is not one."""
    network, averaged, _ = read_checkpoint(path)
    if network.text != learner.network.text:
        raise InputError("is of another network", file=path, hint=_HINT)
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {key: stored[key] for key in stored.files}
        values = json.loads(arrays["progress"].tobytes())
        progress = Progress(**{**values, "losses": tuple(values["losses"])})
        model = parse_weights(arrays["model"].tobytes(), network)
        learner.optimizer.load_state_dict(_optimizer_state(arrays, learner))
    except (KeyError, ValueError, TypeError, OSError) as error:
        raise InputError("holds no training to go on with", file=path, hint=_HINT) from error
    learner.averaged.load(averaged)
    learner.model.load(model)
    return progress


def _averaged(learner: Learner, iteration: int) -> Weights:
    weights: Weights = learner.averaged.weights(iteration * learner.settings.batch)
    return weights


def _optimizer_state(arrays: dict[str, NDArray[np.generic]], learner: Learner) -> dict[str, object]:
    state: dict[int, dict[str, torch.Tensor]] = {}
    for name, array in arrays.items():
        if name.startswith("optimizer/"):
            _, index, key = name.split("/")
            state.setdefault(int(index), {})[key] = torch.from_numpy(np.array(array))
    return {"state": state, "param_groups": learner.optimizer.state_dict()["param_groups"]}
