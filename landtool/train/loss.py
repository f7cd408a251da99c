"""What a step of training makes smaller: darknet's own loss, and one by overlap that learns faster.

Both learn, for each target, the cell its centre lies in; they differ in how many anchors learn it and how its box is
judged. Boxes are cx, cy, w, h in input pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor
from torch.nn import functional

from landtool.train.model import Head, decode

LossName = Literal["overlap", "darknet"]
_EPSILON = 1e-7
# An anchor learns a target whose shape overlaps its own by more than this ("overlap"), besides the best one
_POSITIVE_SHAPE_IOU = 0.3
_BOX_GAIN = 4.0  # of the overlap's loss against the objectness's, both a mean over the anchors that learn
_QUALITY = 0.5  # share of the objectness to learn that goes with the overlap reached: better boxes rank higher


@dataclass(frozen=True, eq=False)
class Targets:
    """What is in a batch. boxes: (N, 4) cx, cy, w, h. picture, label: (N,) int64. ignored: (N,) bool.

    An ignored one is neither learnt nor is finding it an error: a target cut or shrunk too far to be known.
    """

    boxes: Tensor
    picture: Tensor
    label: Tensor
    ignored: Tensor


@dataclass(frozen=True, eq=False)
class Losses:
    """The parts of a loss, each a scalar: of box, objectness and class."""

    box: Tensor
    objectness: Tensor
    classes: Tensor

    @property
    def total(self) -> Tensor:
        """What the step makes smaller."""
        return self.box + self.objectness + self.classes


def darknet_loss(raws: list[Tensor], heads: tuple[Head, ...], targets: Targets) -> Losses:
    """Darknet's loss of YOLOv3, a sum over the cells divided by the number of pictures.

    Centres: cross-entropy of sigmoid(tx), scale_x_y undone; sizes: (tw - t)^2 / 2; both weighted by 2 - w h, shares of
    the picture. Objectness and classes: cross-entropy; a box that overlaps a target by more than the head's
    ignore_thresh is no false one. The anchor of the best shape learns, and those above iou_thresh where the cfg gives
    one.
    """
    batch = raws[0].shape[0]
    width, height = raws[0].shape[3] * heads[0].stride, raws[0].shape[2] * heads[0].stride
    shape_iou = _shape_iou(targets.boxes, heads)
    box = objectness = classes = raws[0].new_zeros(())
    first = 0
    for raw, head in zip(raws, heads, strict=True):
        at = _assign(shape_iou, first, head, targets, raw, head.positive_iou)
        first += len(head.anchors)
        chosen = raw[at.index]
        truth = targets.boxes[at.target]
        weight = 2.0 - truth[:, 2] * truth[:, 3] / (width * height)
        # the sigmoid whose decoded centre is the target's: s sigmoid(t) - (s - 1) / 2 = offset
        offset = (truth[:, :2] / head.stride - at.cell + (head.scale_xy - 1.0) / 2.0) / head.scale_xy
        xy = functional.binary_cross_entropy_with_logits(chosen[:, :2], offset, reduction="none").sum(1)
        size = torch.log(truth[:, 2:] / at.anchor)
        wh = 0.5 * (chosen[:, 2:4] - size).square().sum(1)
        box = box + (weight * (xy + wh)).sum() / batch
        wanted = torch.zeros_like(raw[..., 4])
        wanted[at.index] = 1.0
        counted = _counted(raw, head, targets, at.index, head.ignore_iou)
        entropy = functional.binary_cross_entropy_with_logits(raw[..., 4], wanted, reduction="none")
        objectness = objectness + (entropy * counted).sum() / batch
        classes = classes + _class_loss(chosen, targets.label[at.target]).sum() / batch
    return Losses(box, objectness, classes)


def overlap_loss(raws: list[Tensor], heads: tuple[Head, ...], targets: Targets) -> Losses:
    """A loss by overlap: 1 - CIoU for the box (Zheng et al. 2020), every anchor of like shape learns, of both heads.

    The objectness to learn goes half with the overlap reached. Each part is a mean over the anchors that learn.
    """
    shape_iou = _shape_iou(targets.boxes, heads)
    box = objectness = classes = raws[0].new_zeros(())
    positives, first = 0, 0
    for raw, head in zip(raws, heads, strict=True):
        at = _assign(shape_iou, first, head, targets, raw, _POSITIVE_SHAPE_IOU)
        first += len(head.anchors)
        positives += len(at.target)
        found, _ = decode(raw, head)
        overlap, complete = _overlaps(found[at.index], targets.boxes[at.target])
        box = box + _BOX_GAIN * (1.0 - complete).sum()
        wanted = torch.zeros_like(raw[..., 4])
        wanted[at.index] = 1.0 - _QUALITY + _QUALITY * overlap.detach().clamp(0.0, 1.0)
        counted = _counted(raw, head, targets, at.index, head.ignore_iou)
        entropy = functional.binary_cross_entropy_with_logits(raw[..., 4], wanted, reduction="none")
        objectness = objectness + (entropy * counted).sum()
        classes = classes + _class_loss(raw[at.index], targets.label[at.target]).sum()
    count = max(positives, raws[0].shape[0])  # a batch of backgrounds must not count for more than others
    return Losses(box / count, objectness / count, classes / count)


# What --loss chooses from
LOSSES = {"overlap": overlap_loss, "darknet": darknet_loss}


@dataclass(frozen=True, eq=False)
class _Assigned:
    """Where targets are learnt in one head.

    index: picture, anchor, row, column, each (M,). target: (M,) which one. cell: (M, 2) column, row. anchor: (M, 2).
    """

    index: tuple[Tensor, Tensor, Tensor, Tensor]
    target: Tensor
    cell: Tensor
    anchor: Tensor


def _shape_iou(boxes: Tensor, heads: tuple[Head, ...]) -> Tensor:
    """Return (N, anchors of all heads) the overlap of each target with each anchor laid on its centre."""
    anchors = torch.tensor([anchor for head in heads for anchor in head.anchors], dtype=boxes.dtype)
    both = torch.minimum(boxes[:, None, 2:], anchors[None]).prod(-1)
    return both / (boxes[:, None, 2:].prod(-1) + anchors.prod(-1)[None] - both + _EPSILON)


def _assign(shape_iou: Tensor, first: int, head: Head, targets: Targets, raw: Tensor, positive_iou: float) -> _Assigned:
    """Say which anchors of a head learn which targets; where two want the same, the last one gets it."""
    count, (rows, columns) = len(head.anchors), raw.shape[2:4]
    learns = shape_iou > positive_iou
    if len(shape_iou):
        learns[torch.arange(len(shape_iou)), shape_iou.argmax(1)] = True
    learns = learns[:, first : first + count] & ~targets.ignored[:, None]
    target, anchor = learns.nonzero(as_tuple=True)
    column = (targets.boxes[target, 0] / head.stride).long().clamp(0, columns - 1)
    row = (targets.boxes[target, 1] / head.stride).long().clamp(0, rows - 1)
    index = (targets.picture[target], anchor, row, column)
    flat = ((index[0] * count + anchor) * rows + row) * columns + column
    keep = _last_of_each(flat)
    index = (index[0][keep], anchor[keep], row[keep], column[keep])
    cell = torch.stack([index[3], index[2]], dim=1).to(raw.dtype)
    return _Assigned(index, target[keep], cell, torch.tensor(head.anchors, dtype=raw.dtype)[index[1]])


def _last_of_each(values: Tensor) -> Tensor:
    """Return the indices of the last of equal values."""
    order = torch.argsort(values, stable=True)
    ordered = values[order]
    last = torch.ones_like(ordered, dtype=torch.bool)
    last[:-1] = ordered[1:] != ordered[:-1]
    return order[last]


def _counted(
    raw: Tensor, head: Head, targets: Targets, learning: tuple[Tensor, Tensor, Tensor, Tensor], ignore_iou: float
) -> Tensor:
    """Return (B, anchors, h, w): 0 for boxes that are no error though they learn no target, 1 for the others."""
    counted = torch.ones_like(raw[..., 4])
    with torch.no_grad():
        boxes, _ = decode(raw.detach(), head)
        for picture in sorted(set(targets.picture.tolist())):
            mine = targets.picture == picture
            iou, inside = _pair_overlaps(boxes[picture].reshape(-1, 4), targets.boxes[mine])
            no_error = (iou > ignore_iou).any(1) | (inside[:, targets.ignored[mine]] > 0.5).any(1)
            counted[picture] = (~no_error).view_as(counted[picture]).to(counted.dtype)
    counted[learning] = 1.0
    return counted


def _pair_overlaps(found: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """Return (M, N) intersection over union, and the share of each found box that lies in each true one."""
    low = torch.maximum(_corner(found, -0.5)[:, None], _corner(truth, -0.5)[None])
    high = torch.minimum(_corner(found, 0.5)[:, None], _corner(truth, 0.5)[None])
    both = (high - low).clamp(min=0.0).prod(-1)
    area = found[:, None, 2:].prod(-1)
    return both / (area + truth[None, :, 2:].prod(-1) - both + _EPSILON), both / (area + _EPSILON)


def _overlaps(found: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """Return IoU and complete IoU of pairs of boxes, (M,) each.

    CIoU = IoU - d^2 / c^2 - a v: centre distance over the diagonal around both, and the difference in aspect.
    """
    low = torch.maximum(_corner(found, -0.5), _corner(truth, -0.5))
    high = torch.minimum(_corner(found, 0.5), _corner(truth, 0.5))
    both = (high - low).clamp(min=0.0).prod(-1)
    iou = both / (found[:, 2:].prod(-1) + truth[:, 2:].prod(-1) - both + _EPSILON)
    around = torch.maximum(_corner(found, 0.5), _corner(truth, 0.5)) - torch.minimum(
        _corner(found, -0.5), _corner(truth, -0.5)
    )
    distance = (found[:, :2] - truth[:, :2]).square().sum(-1) / (around.square().sum(-1) + _EPSILON)
    aspect = torch.atan(truth[:, 2] / truth[:, 3]) - torch.atan(found[:, 2] / (found[:, 3] + _EPSILON))
    v = 4.0 / math.pi**2 * aspect.square()
    with torch.no_grad():
        a = v / (1.0 - iou + v + _EPSILON)
    return iou, iou - distance - a * v


def _corner(boxes: Tensor, side: float) -> Tensor:
    return boxes[..., :2] + side * boxes[..., 2:]


def _class_loss(chosen: Tensor, label: Tensor) -> Tensor:
    wanted = torch.zeros_like(chosen[:, 5:])
    wanted[torch.arange(len(label)), label] = 1.0
    return functional.binary_cross_entropy_with_logits(chosen[:, 5:], wanted, reduction="none").sum(1)
