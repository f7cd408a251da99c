"""The losses: numbers worked out by hand, and whether a network learns by them."""

from __future__ import annotations

import math
from itertools import product

import pytest

torch = pytest.importorskip("torch", reason="torch is not installed: pip install 'landtool[train]'")

from landtool.darknet.cfg import parse_cfg  # noqa: E402
from landtool.train.loss import LOSSES, Losses, Targets, darknet_loss, overlap_loss  # noqa: E402
from landtool.train.model import Head, TinyYolo, decode, output0  # noqa: E402
from tests.unit.darknet.networks import layer  # noqa: E402

# pictures of 16 x 16, four cells; two anchors of one class
ANCHORS = ((10.0, 10.0), (30.0, 20.0))
HEAD = Head(ANCHORS, 8, 1.0, 0.5, 1.0)
TARGET = (6.0, 10.0, 8.0, 10.0)  # in the left lower cell, most like the first anchor
LEARNING = (0, 0, 1, 0)
Box = tuple[float, float, float, float]

THREE = "".join(
    [
        "[net]\nwidth=64\nheight=64\nchannels=3\n\n",
        *(layer(batch_normalize=1, filters=n, size=3, stride=2, pad=1, activation="leaky") for n in (8, 16, 32)),
        layer(filters=12, size=1, activation="linear"),
        "[yolo]\nmask=0,1\nanchors=14,14, 30,24\nclasses=1\nnum=2\nignore_thresh=.7\n",
    ]
)


def targets(*boxes: Box, pictures: tuple[int, ...] | None = None, ignored: tuple[bool, ...] | None = None) -> Targets:
    count = len(boxes)
    return Targets(
        torch.tensor(boxes, dtype=torch.float32).reshape(count, 4),
        torch.tensor(pictures or (0,) * count, dtype=torch.int64),
        torch.zeros(count, dtype=torch.int64),
        torch.tensor(ignored or (False,) * count, dtype=torch.bool),
    )


def entropy(logit: float, wanted: float) -> float:
    """Cross-entropy of a sigmoid: -y log s - (1 - y) log (1 - s)."""
    s = 1.0 / (1.0 + math.exp(-logit))
    return -wanted * math.log(s) - (1.0 - wanted) * math.log(1.0 - s)


def some_raw() -> torch.Tensor:
    """What the head might say: nothing but at the learning anchor."""
    raw = torch.zeros(1, 2, 2, 2, 6)
    raw[LEARNING] = torch.tensor([0.3, -0.2, 0.1, -0.4, 0.7, -0.5])
    return raw.requires_grad_()


def gradient(losses: Losses, raw: torch.Tensor) -> torch.Tensor:
    (found,) = torch.autograd.grad(losses.total, raw)
    return found


def test_darknets_loss_is_that_of_its_formulas() -> None:
    raw = some_raw()
    losses = darknet_loss([raw], (HEAD,), targets(TARGET))
    weight = 2.0 - 8.0 * 10.0 / 16.0**2
    xy = entropy(0.3, 6.0 / 8.0) + entropy(-0.2, 10.0 / 8.0 - 1.0)
    wh = ((0.1 - math.log(8.0 / 10.0)) ** 2 + (-0.4 - math.log(10.0 / 10.0)) ** 2) / 2.0
    assert losses.box.item() == pytest.approx(weight * (xy + wh), rel=1e-5)
    assert losses.objectness.item() == pytest.approx(entropy(0.7, 1.0) + 7 * math.log(2.0), rel=1e-5)
    assert losses.classes.item() == pytest.approx(entropy(-0.5, 1.0), rel=1e-5)
    # darknet's own deltas: weight (sigmoid(tx) - x), weight (tw - t), sigmoid(objectness) - 1
    found = gradient(losses, raw)[LEARNING].tolist()
    sigmoid = [1.0 / (1.0 + math.exp(-t)) for t in (0.3, -0.2, 0.7, -0.5)]
    assert found == pytest.approx(
        [
            weight * (sigmoid[0] - 0.75),
            weight * (sigmoid[1] - 0.25),
            weight * (0.1 - math.log(0.8)),
            weight * -0.4,
            sigmoid[2] - 1.0,
            sigmoid[3] - 1.0,
        ],
        rel=1e-4,
    )


def test_a_box_that_overlaps_a_target_is_no_false_one() -> None:
    # of the target, 2..10 x 5..15, the first anchor's upper left box, -1..9 x -1..9, has 7 x 4: 28 of 100 + 80 - 28,
    # an overlap of 0.184; the next best, the lower right one, 7..17 x 7..17, 24 of 156, 0.154
    raw = some_raw()
    loose = Head(ANCHORS, 8, 1.0, 0.17, 1.0)
    losses = darknet_loss([raw], (loose,), targets(TARGET))
    assert losses.objectness.item() == pytest.approx(entropy(0.7, 1.0) + 6 * math.log(2.0), rel=1e-5)
    assert gradient(losses, raw)[0, 0, 0, 0].abs().sum() == 0.0


def test_darknets_loss_is_a_mean_over_pictures() -> None:
    one = darknet_loss([some_raw()], (HEAD,), targets(TARGET))
    two = darknet_loss([torch.cat([some_raw(), some_raw()])], (HEAD,), targets(TARGET, TARGET, pictures=(0, 1)))
    assert float(two.total.detach()) == pytest.approx(float(one.total.detach()), rel=1e-6)


def test_iou_thresh_lets_more_anchors_learn() -> None:
    # the second anchor's overlap with the target's shape is 80 / 600
    for threshold, learning in ((1.0, 1), (0.14, 1), (0.13, 2)):
        raw = torch.zeros(1, 2, 2, 2, 6, requires_grad=True)
        found = gradient(darknet_loss([raw], (Head(ANCHORS, 8, 1.0, 0.9, threshold),), targets(TARGET)), raw)
        assert int((found[..., 2] != 0).sum()) == learning


@pytest.mark.parametrize("scale_xy", [1.0, 1.1, 2.0])
def test_darknets_loss_pulls_the_centre_to_that_of_the_target(scale_xy: float) -> None:
    head = Head(ANCHORS, 8, scale_xy, 0.5, 1.0)
    raw = torch.zeros(1, 2, 2, 2, 6, requires_grad=True)
    optimizer = torch.optim.SGD([raw], lr=1.0)
    for _ in range(60):
        optimizer.zero_grad()
        darknet_loss([raw], (head,), targets(TARGET)).total.backward()
        optimizer.step()
    box = decode(raw.detach(), head)[0][LEARNING]
    assert box.tolist() == pytest.approx(TARGET, abs=0.1)


def test_the_overlap_loss_is_that_of_its_formulas() -> None:
    raw = some_raw()
    head = Head(ANCHORS[:1], 8, 1.0, 0.9, 1.0)
    losses = overlap_loss([raw[:, :1]], (head,), targets(TARGET))
    x, y, w, h = decode(raw.detach(), HEAD)[0][LEARNING].tolist()
    across = min(x + w / 2, 10.0) - max(x - w / 2, 2.0)
    down = min(y + h / 2, 15.0) - max(y - h / 2, 5.0)
    iou = across * down / (w * h + 80.0 - across * down)
    diagonal = (max(x + w / 2, 10.0) - min(x - w / 2, 2.0)) ** 2 + (max(y + h / 2, 15.0) - min(y - h / 2, 5.0)) ** 2
    aspect = 4.0 / math.pi**2 * (math.atan(8.0 / 10.0) - math.atan(w / h)) ** 2
    complete = iou - ((x - 6.0) ** 2 + (y - 10.0) ** 2) / diagonal - aspect**2 / (1.0 - iou + aspect)
    assert losses.box.item() == pytest.approx(4.0 * (1.0 - complete), rel=1e-4)
    wanted = 0.5 + 0.5 * iou
    assert losses.objectness.item() == pytest.approx(entropy(0.7, wanted) + 3 * math.log(2.0), rel=1e-4)
    assert losses.classes.item() == pytest.approx(entropy(-0.5, 1.0), rel=1e-5)


@pytest.mark.parametrize("name", LOSSES)
def test_an_ignored_target_is_neither_learnt_nor_a_false_one(name: str) -> None:
    raw = torch.zeros(1, 2, 2, 2, 6, requires_grad=True)
    # the first anchor's box of the lower right cell, 7..17 x 7..17, lies in it, the others at most half
    losses = LOSSES[name]([raw], (HEAD,), targets((13.0, 13.0, 14.0, 14.0), ignored=(True,)))
    found = gradient(losses, raw)
    assert losses.box.item() == losses.classes.item() == 0.0
    assert found[0, 0, 1, 1].abs().sum() == 0.0
    assert (found[0, 0, 0, 0, 4], found[0, 1, 0, 0, 4]) > (0.0, 0.0)
    assert found[..., :4].abs().sum() == found[..., 5:].abs().sum() == 0.0


@pytest.mark.parametrize("name", LOSSES)
def test_a_cell_with_two_targets_learns_the_last(name: str) -> None:
    other = (4.0, 12.0, 12.0, 9.0)
    both, last = (
        LOSSES[name]([some_raw()], (Head(ANCHORS, 8, 1.0, 2.0, 1.0),), of)
        for of in (targets(TARGET, other), targets(other))
    )
    assert both.box.item() == pytest.approx(last.box.item())
    assert both.objectness.item() == pytest.approx(last.objectness.item())


@pytest.mark.parametrize("name", LOSSES)
def test_two_targets_of_different_shape_learn_in_one_cell(name: str) -> None:
    raw = torch.zeros(1, 2, 2, 2, 6, requires_grad=True)
    found = gradient(LOSSES[name]([raw], (HEAD,), targets(TARGET, (5.0, 11.0, 28.0, 19.0))), raw)
    assert (found[0, :, 1, 0, 2:4].abs().sum(dim=1) > 0.0).all()


@pytest.mark.parametrize("name", LOSSES)
def test_backgrounds_only_push_objectness_down(name: str) -> None:
    raw = torch.zeros(3, 2, 2, 2, 6, requires_grad=True)
    losses = LOSSES[name]([raw], (HEAD,), targets())
    assert losses.box.item() == losses.classes.item() == 0.0
    assert losses.objectness.item() == pytest.approx(8 * math.log(2.0))
    found = gradient(losses, raw)
    assert (found[..., 4] > 0.0).all()
    assert found[..., :4].abs().sum() == 0.0


@pytest.mark.parametrize("name", LOSSES)
@pytest.mark.parametrize(("x", "y"), list(product((0.0, 0.3, 15.7, 16.0), (0.0, 16.0))))
def test_boxes_at_the_border_are_learnt_in_the_last_cell(name: str, x: float, y: float) -> None:
    raw = torch.zeros(1, 2, 2, 2, 6, requires_grad=True)
    losses = LOSSES[name]([raw], (HEAD,), targets((x, y, 0.6, 8.0)))
    found = gradient(losses, raw)
    assert torch.isfinite(found).all()
    assert math.isfinite(float(losses.total.detach()))
    learning = found[..., 2].abs().sum(dim=1)[0].nonzero().tolist()
    assert learning == [[int(y > 8.0), int(x > 8.0)]]


@pytest.mark.parametrize("name", LOSSES)
def test_absurd_outputs_have_a_finite_loss(name: str) -> None:
    raw = torch.full((1, 2, 2, 2, 6), 60.0, requires_grad=True)
    losses = LOSSES[name]([raw], (HEAD,), targets(TARGET))
    assert math.isfinite(float(losses.total.detach()))
    assert torch.isfinite(gradient(losses, raw)).all()


@pytest.mark.parametrize("name", LOSSES)
def test_a_network_learns_one_picture(name: str) -> None:
    torch.manual_seed(0)
    model = TinyYolo(parse_cfg(THREE))
    box: Box = (38.0, 27.0, 20.0, 14.0)
    pictures = torch.full((1, 3, 64, 64), 0.3)
    pictures[0, 0, 20:34, 28:48] = 0.9
    optimizer = torch.optim.Adam(model.parameters(), lr=0.02)
    totals = []
    for _ in range(60):
        optimizer.zero_grad()
        losses = LOSSES[name](model(pictures), model.heads, targets(box))
        losses.total.backward()
        optimizer.step()
        totals.append(float(losses.total.detach()))
    assert totals[-1] < 0.3 * totals[0]
    with torch.no_grad():
        found = output0(model(pictures), model.heads)[0]
    best = found[:, int(found[4].argmax())].tolist()
    assert best[4] > 0.5
    assert best[:4] == pytest.approx(box, abs=2.5)
