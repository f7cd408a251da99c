"""One step of training: a batch in, better weights and a running mean of them out."""

from __future__ import annotations

import copy
import math
import time
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from landtool.darknet.network import Network
from landtool.train.batches import Batch
from landtool.train.loss import LOSSES, Losses, Targets
from landtool.train.model import TinyYolo
from landtool.train.settings import TrainSettings

_MOST_GRADIENT = 10.0  # norm beyond which a step is shortened
_LEAST_RATE = 0.01  # of the highest, where the cosine ends
_MOMENTUM = 0.9
_TRIAL_PICTURES, _TRIAL_SIDE, _TRIAL_ROUNDS = 8, 224, 3


@dataclass(frozen=True)
class StepLoss:
    """The parts of a step's loss."""

    box: float
    objectness: float
    classes: float

    @property
    def total(self) -> float:
        """Their sum."""
        return self.box + self.objectness + self.classes


class Learner:
    """A network with what is needed to make it better.

    averaged: the same network with the running mean of the weights, which is validated and kept; the network itself
    when no mean is asked for.
    """

    def __init__(self, network: Network, settings: TrainSettings, *, bf16: bool) -> None:
        torch.manual_seed(settings.seed)
        self.settings, self.network, self._bf16 = settings, network, bf16
        self.model = TinyYolo(network).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.averaged = copy.deepcopy(self.model) if settings.average else self.model
        self.optimizer = _optimizer(self.model, settings)

    def learn(self, batch: Batch) -> StepLoss:
        """Take one step. The loss is not finite when the training has failed; nothing was changed then."""
        self.model.train()
        for group in self.optimizer.param_groups:
            group["lr"] = learning_rate(batch.iteration, self.settings, self.network)
        self.optimizer.zero_grad(set_to_none=True)
        losses = self._losses(batch)
        loss = StepLoss(float(losses.box.detach()), float(losses.objectness.detach()), float(losses.classes.detach()))
        if not math.isfinite(loss.total):
            return loss
        losses.total.backward()  # type: ignore[no-untyped-call]
        norm = torch.nn.utils.clip_grad_norm_(self.model.parameters(), _limit(self.settings))
        if not math.isfinite(float(norm)):
            return StepLoss(math.nan, math.nan, math.nan)
        self.optimizer.step()
        self._average(batch.iteration)
        return loss

    def _losses(self, batch: Batch) -> Losses:
        pictures = pictures_of(batch.pictures)
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=self._bf16):
            raws = self.model(pictures)
        targets = Targets(
            torch.from_numpy(batch.boxes),
            torch.from_numpy(batch.picture),
            torch.from_numpy(batch.label),
            torch.from_numpy(batch.ignored),
        )
        return LOSSES[self.settings.loss]([raw.float() for raw in raws], self.model.heads, targets)

    def _average(self, iteration: int) -> None:
        if self.averaged is self.model:
            return
        # at the start, when the weights move most, the mean follows closely
        keep = min(self.settings.average, (1.0 + iteration) / (10.0 + iteration))
        with torch.no_grad():
            for mean, now in zip(self.averaged.state_dict().values(), self.model.state_dict().values(), strict=True):
                if mean.dtype.is_floating_point:
                    mean.lerp_(now, 1.0 - keep)
                else:
                    mean.copy_(now)


def learning_rate(iteration: int, settings: TrainSettings, network: Network) -> float:
    """Return the rate of an iteration: a rise, then a cosine, or the steps of the cfg."""
    highest = settings.learning_rate
    if iteration < settings.warm_up:
        risen = (iteration + 1) / settings.warm_up
        # darknet's burn-in rises with the fourth power
        return highest * (risen**4 if settings.schedule == "steps" else risen)
    if settings.schedule == "steps":
        return highest * math.prod(
            scale
            for step, scale in zip(network.training.steps, network.training.scales, strict=True)
            if iteration >= step
        )
    done = (iteration - settings.warm_up) / max(1, settings.iterations - settings.warm_up)
    return highest * (_LEAST_RATE + (1.0 - _LEAST_RATE) * 0.5 * (1.0 + math.cos(math.pi * min(1.0, done))))


def pictures_of(pictures: NDArray[np.uint8]) -> Tensor:
    """Return (B, 3, H, W) float32 in [0, 1], channels last in memory, of (B, H, W, 3) RGB uint8."""
    return torch.from_numpy(pictures).permute(0, 3, 1, 2).float().div_(255.0)


def bf16_gains(network: Network) -> tuple[float, float]:
    """Return the pictures a second that one step learns from in float32 and in bf16, measured."""
    speeds = []
    for bf16 in (False, True):
        learner = Learner(network, TrainSettings(), bf16=bf16)
        pictures = torch.rand(_TRIAL_PICTURES, 3, _TRIAL_SIDE, _TRIAL_SIDE).to(memory_format=torch.channels_last)
        best = math.inf
        for _ in range(_TRIAL_ROUNDS):
            start = time.perf_counter()
            with torch.autocast("cpu", dtype=torch.bfloat16, enabled=bf16):
                raws = learner.model(pictures)
            sum(raw.float().square().mean() for raw in raws).backward()
            best = min(best, time.perf_counter() - start)
        speeds.append(_TRIAL_PICTURES / best)
    return speeds[0], speeds[1]


def uses_bf16(choice: Literal["auto", "on", "off"], float32: float, bf16: float) -> bool:
    """Return whether to calculate in bf16, given both speeds."""
    return choice == "on" or (choice == "auto" and bf16 > 1.1 * float32)


def _limit(settings: TrainSettings) -> float:
    return _MOST_GRADIENT if settings.loss == "overlap" else math.inf  # darknet cuts nothing


def _optimizer(model: TinyYolo, settings: TrainSettings) -> torch.optim.Optimizer:
    """Return what moves the weights; decay is for kernels only, as in darknet."""
    kernels = [p for p in model.parameters() if p.ndim > 1]
    others = [p for p in model.parameters() if p.ndim <= 1]
    groups = [{"params": kernels, "weight_decay": settings.weight_decay}, {"params": others, "weight_decay": 0.0}]
    if settings.optimizer == "sgd":
        return torch.optim.SGD(groups, lr=settings.learning_rate, momentum=_MOMENTUM)
    return torch.optim.AdamW(groups, lr=settings.learning_rate, betas=(0.9, 0.99))
