"""Fit what landtool.dehaze.veil knows: draw scenes, put fog before them, learn to take it off again.

`python tools/fit_veil.py [--backgrounds DIR]... [--out runs/veil]`: about half an hour on two cores, most of it for the
scenes, which are kept in --out. Needs torch. Writes landtool/data/veil.npz, and prints how well it does on scenes it
has not seen.
"""

from __future__ import annotations

import argparse
import math
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from landtool.dehaze.statistics import DARK, SHARES, small_copy, statistics
from landtool.dehaze.veil import LEAST_TRANSMISSION, OUTPUTS, SLOPE, TINT, VEIL_OF_DARK
from landtool.pad import PadSpec
from landtool.synth.compose import render
from landtool.synth.dataset.backgrounds import find_backgrounds
from landtool.synth.domain import Domain
from landtool.synth.random_scene import draw_scene

ROOT = Path(__file__).resolve().parents[1]
FITTED = ROOT / "landtool" / "data" / "veil.npz"
SETS = {11: 1300, 12: 1300, 13: 1600, 14: 1600, 15: 1600}  # seed of the scenes, and how many
FOGS = 6  # before each scene, all different
HIDDEN = 48
GUESSES = 5  # of as many regressions; their mean is off by less than each
RISK = 3.0  # a decibel lost counts for that many more
LUMA = torch.tensor([0.0722, 0.7152, 0.2126])[None, :, None, None]
Batch = dict[str, Tensor]


def main() -> None:
    """Draw, fit, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--backgrounds", action="append", default=[], help="photographs to lay on the ground")
    parser.add_argument("--out", type=Path, default=ROOT / "runs" / "veil")
    parser.add_argument("--steps", type=int, default=5000)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(0)
    torch.set_num_threads(1)
    with ProcessPoolExecutor() as pool:
        files = list(pool.map(partial(draw, options.out, options.backgrounds), SETS))
    seen, unseen = examples(files)
    net = fit(seen, unseen, options.steps)
    np.savez_compressed(FITTED, **{k: v.numpy().astype(np.float32) for k, v in net.state_dict().items()})
    print(f"{FITTED}: {FITTED.stat().st_size} bytes")


def draw(out: Path, backgrounds: list[str], seed: int) -> Path:
    """Draw the scenes of a seed in clear air: light (n, 120, 160, 3), distance (n, 120, 160), level (n,)."""
    file = out / f"scenes-{seed}.npz"
    if file.exists():
        return file
    cv2.setNumThreads(1)
    photos = [Path(photo.path) for photo in find_backgrounds(backgrounds)]
    light, distance, level = [], [], []
    for index in range(SETS[seed]):
        rng = np.random.default_rng([seed, index])
        drawn = draw_scene(Domain(fog=0.0, absent=0.15), PadSpec(), (320, 240), photos, rng)
        rendered = render(drawn.scene, drawn.view)
        near = np.minimum(rendered.distance_m, 1000.0).astype(np.float32)
        for kept, full in ((light, np.minimum(rendered.linear, 8.0)), (distance, near)):
            kept.append(cv2.resize(full, (160, 120), interpolation=cv2.INTER_AREA).astype(np.float16))
        level.append(drawn.level)
    np.savez(file, L=np.array(light), D=np.array(distance), level=np.array(level, np.float32))
    return file


def examples(files: list[Path]) -> tuple[Batch, Batch]:
    """Return examples to learn from, and of every tenth scene some to judge by."""
    parts: list[Batch] = []
    for file in files:
        held = np.load(file)
        light = functional.avg_pool2d(torch.from_numpy(held["L"]).float().permute(0, 3, 1, 2), 2)
        distance = functional.avg_pool2d(torch.from_numpy(held["D"]).float()[:, None], 2)
        level = torch.from_numpy(held["level"])
        for _ in range(FOGS):
            for start in range(0, len(light), 50):
                rows = slice(start, start + 50)
                batch = foggy(light[rows], distance[rows], level[rows])
                parts.append({**batch, "unseen": torch.arange(start, start + len(level[rows])) % 10 == 0})
    whole = {k: torch.cat([p[k] for p in parts]) for k in parts[0]}
    unseen = whole.pop("unseen")
    return {k: v[~unseen] for k, v in whole.items()}, {k: v[unseen] for k, v in whole.items()}


def uniform(n: int, low: float, high: float) -> Tensor:
    """Return values (n, 1, 1, 1) drawn evenly."""
    return (torch.rand(n) * (high - low) + low)[:, None, None, None]


def log_uniform(n: int, low: float, high: float) -> Tensor:
    """Return values (n, 1, 1, 1) drawn evenly in their logarithm."""
    return torch.exp(uniform(n, math.log(low), math.log(high)))


def foggy(light: Tensor, distance: Tensor, level: Tensor) -> Batch:
    """Put fog before scenes (N, 3, 60, 80) and take two pictures of each, with the fog and without."""
    n = len(light)
    flips = [axis for axis in (2, 3) if torch.rand(1) < 0.5]
    light, distance = light.flip(flips), distance.flip(flips)
    exposure = torch.exp(uniform(n, -0.3, 0.3))
    level = level[:, None, None, None] * exposure
    light = contrasty(light * exposure, level)
    # optical depth of the median pixel: 15 % clear, most of the others thick enough to matter
    depth = torch.where(uniform(n, 0, 1) < 0.2, log_uniform(n, 0.01, 0.15), log_uniform(n, 0.08, 2.3))
    depth = torch.where(uniform(n, 0, 1) < 0.15, torch.zeros_like(depth), depth)
    middle = distance.reshape(n, -1).median(dim=1).values[:, None, None, None]
    t = torch.exp(-depth * (distance / middle).clamp(max=50.0) * banks(n, distance.shape[2:]))
    # from above little light is scattered back: the airlight of path-traced fogs is 0.15 to 0.45 of white
    grey = (log_uniform(n, 0.10, 0.70) * level).clamp(0.02, 0.98)
    air = grey * (1.0 + 0.06 * torch.randn(n, 3, 1, 1))
    # fog spreads and swallows some of the light that falls on the ground
    dimmed = torch.exp(0.12 * torch.randn(n, 1, 1, 1) * (1.0 - torch.exp(-3.0 * depth)))
    fog, clear = pictures(dimmed * light * t + air * (1.0 - t), light)
    small = [np.ascontiguousarray(f.permute(1, 2, 0).numpy()) for f in (fog * 255.0).round().byte()]
    return {
        "statistics": torch.from_numpy(np.stack([statistics(small_copy(s)) for s in small])),
        "fog": functional.avg_pool2d(fog, 4),
        "clear": functional.avg_pool2d(clear, 4),
        "haze": 1.0 - t.reshape(n, -1).median(dim=1).values,
    }


def contrasty(light: Tensor, level: Tensor) -> Tensor:
    """Return scenes with other contrasts and more texture than drawn ones have, as real ones are."""
    n, _, height, width = light.shape
    scenes = level * (light / level).clamp(min=1e-4) ** uniform(n, 0.9, 1.15)
    strength = torch.where(uniform(n, 0, 1) < 0.6, uniform(n, 0.0, 0.2), torch.zeros(n, 1, 1, 1))
    coarse = functional.interpolate(torch.randn(n, 1, height // 4, width // 4), size=(height, width), mode="bilinear")
    scenes = scenes * torch.exp(strength * (0.5 * torch.randn(n, 1, height, width) + 0.8 * coarse))
    # as bright on the mean as before: cameras see to that
    return scenes * (light.mean(dim=(1, 2, 3)) / scenes.mean(dim=(1, 2, 3)))[:, None, None, None]


def banks(n: int, shape: tuple[int, ...]) -> Tensor:
    """Return the density of the air, as a multiple of its mean: even, or in banks."""
    waves = functional.interpolate(torch.randn(n, 1, 3, 4), size=shape, mode="bicubic", align_corners=False)
    strength = torch.where(uniform(n, 0, 1) < 0.4, uniform(n, 0.0, 0.35), torch.zeros(n, 1, 1, 1))
    return (1.0 + strength * waves).clamp(min=0.1)


def pictures(fog: Tensor, clear: Tensor) -> tuple[Tensor, Tensor]:
    """Return what one camera makes of two lights (N, 3, h, w), with noise and without, in [0, 1]."""
    n, _, height, width = fog.shape
    gains = torch.exp(0.24 * torch.rand(n, 3, 1, 1) - 0.12)
    y, x = torch.meshgrid(torch.linspace(-1, 1, height), torch.linspace(-1, 1, width), indexing="ij")
    vignette = 1.0 / (1.0 + uniform(n, 0.0, 0.2) * (x * x + y * y) / 2.0) ** 2
    plain = uniform(n, 0, 1) < 0.2
    saturation, contrast, gamma = (
        torch.where(plain, torch.full_like(plain, none, dtype=torch.float32), value)
        for none, value in (
            (1.0, uniform(n, 0.75, 1.25)),
            (0.0, uniform(n, -0.1, 0.35)),
            (1.0, torch.exp(0.08 * torch.randn(n, 1, 1, 1))),
        )
    )
    shot, read = uniform(n, 0.004, 0.05) ** 2, uniform(n, 0.0005, 0.008) ** 2

    def developed(light: Tensor, noise: float) -> Tensor:
        light = (light * gains * vignette).clamp(max=1.0)
        light = light + noise * torch.randn_like(light) * torch.sqrt(light * shot + read)
        luma = (light * LUMA).sum(dim=1, keepdim=True)
        curve = encode(luma + saturation * (light - luma)).clamp(min=1e-5) ** gamma
        return (curve + contrast * (curve * curve * (3.0 - 2.0 * curve) - curve)).clamp(0.0, 1.0)

    # a small copy keeps about a quarter of the noise: neighbours of a mosaic err together
    return developed(fog, 0.25), developed(clear, 0.0)


def decode(values: Tensor) -> Tensor:
    """Return the linear light of sRGB values."""
    return torch.where(values <= 0.04045, values / 12.92, ((values.clamp(min=1e-6) + 0.055) / 1.055) ** 2.4)


def encode(light: Tensor) -> Tensor:
    """Return the sRGB values of linear light."""
    x = light.clamp(0.0, 1.0)
    return torch.where(x <= 0.0031308, 12.92 * x, 1.055 * x.clamp(min=1e-6) ** (1.0 / 2.4) - 0.055)


class Net(nn.Module):
    """From statistics to the numbers of a veil, several guesses at once, as landtool.dehaze.veil evaluates it."""

    def __init__(self, known: Tensor) -> None:
        super().__init__()
        self.register_buffer("mean", known.mean(dim=0))
        self.register_buffer("spread", known.std(dim=0) + 1e-3)
        sizes = {"first": (known.shape[1], HIDDEN), "second": (HIDDEN, HIDDEN), "last": (HIDDEN, OUTPUTS)}
        for name, (inward, outward) in sizes.items():
            scale = 0.0 if name == "last" else inward**-0.5
            weight = scale * (2.0 * torch.rand(GUESSES, inward, outward) - 1.0)
            setattr(self, f"{name}_weight", nn.Parameter(weight))
            setattr(self, f"{name}_bias", nn.Parameter(torch.zeros(GUESSES, 1, outward)))

    def forward(self, known: Tensor) -> Tensor:
        """Return the outputs (GUESSES, N, OUTPUTS) of statistics (N, F), or (GUESSES, N, F)."""
        z = ((known - self.mean) / self.spread).expand(GUESSES, -1, -1)
        z = torch.tanh(z @ self.first_weight + self.first_bias)
        z = torch.tanh(z @ self.second_weight + self.second_bias)
        return z @ self.last_weight + self.last_bias


def cleared(outputs: Tensor, known: Tensor, fog: Tensor) -> Tensor:
    """Return pictures (N, 3, h, w) without the veil that the outputs say is before them."""
    n, _, height, width = fog.shape
    dark = decode(known[:, [c * len(SHARES) + DARK for c in range(3)]])
    tint = torch.exp(TINT * torch.stack([outputs[:, 1], torch.zeros(n), outputs[:, 2]], dim=1))
    veil = torch.sigmoid(outputs[:, :1]) * VEIL_OF_DARK * 0.5 * (dark + dark.mean(dim=1, keepdim=True) * tint)
    y, x = torch.meshgrid(torch.linspace(-1, 1, height), torch.linspace(-1, 1, width), indexing="ij")
    rise = torch.exp(SLOPE * (outputs[:, 3, None, None] * x + outputs[:, 4, None, None] * y)).clamp(0.2, 5.0)
    lost = torch.sigmoid(outputs[:, 5])[:, None, None]
    t = (1.0 - lost * rise).clamp(min=LEAST_TRANSMISSION)[:, None]
    airlight = veil[:, :, None, None] / lost[:, None]
    return encode((decode(fog) - airlight) / t + airlight)


def fit(seen: Batch, unseen: Batch, steps: int) -> Net:
    """Return a network whose guesses were taught, each for itself, to gain the most decibels, and to lose few."""
    net = Net(seen["statistics"])
    optimizer = torch.optim.AdamW(net.parameters(), lr=4e-3, weight_decay=2e-2)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps, 1e-5)
    began = time.monotonic()
    for step in range(steps):
        rows = torch.randint(len(seen["haze"]), (GUESSES * 32,))
        batch = {k: v[rows] for k, v in seen.items()}
        blurred = batch["statistics"] + 0.05 * net.spread * torch.randn_like(batch["statistics"])
        outputs = net(blurred.reshape(GUESSES, 32, -1)).reshape(GUESSES * 32, OUTPUTS)
        worse = losses(outputs, batch)
        haze = (torch.sigmoid(outputs[:, 6]) - batch["haze"]).abs()
        # what is hardly hazy is left alone anyway
        counts = (batch["haze"] > 0.08).float()
        loss = ((worse + RISK * worse.clamp(min=0.0)) * counts).mean() + 10.0 * haze.mean()
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), float(GUESSES))
        optimizer.step()
        schedule.step()
        if step % 1000 == 999 or step == steps - 1:
            print(f"{step + 1} steps, {time.monotonic() - began:.0f} s: {judged(net, unseen)}", flush=True)
    return net


def losses(outputs: Tensor, batch: Batch) -> Tensor:
    """Return by how many decibels (N,) pictures come out worse than they were."""
    known, fog, clear = batch["statistics"], batch["fog"], batch["clear"]
    out = cleared(outputs, known, fog)
    # noise is taken off with the veil, and what stays of it grows: 2 grey levels here
    grown = (cleared(outputs, known, (fog + 1.0 / 255.0).clamp(max=1.0)) - out) * 2.0
    error = ((out - clear) ** 2 + grown**2).mean(dim=(1, 2, 3))
    before = ((fog - clear) ** 2).mean(dim=(1, 2, 3))
    # a hundredth of full scale is not worth a risk
    return 10.0 * torch.log10((error + 1e-4) / (before + 1e-4))


@torch.no_grad()
def judged(net: Net, unseen: Batch) -> str:
    """Return how well scenes come out that the network has not seen."""
    outputs = net(unseen["statistics"]).mean(dim=0)
    worse = losses(outputs, unseen)
    gain = -worse[unseen["haze"] > 0.15]
    haze = (torch.sigmoid(outputs[:, 6]) - unseen["haze"]).abs()
    clear = torch.sigmoid(outputs[:, 6])[unseen["haze"] == 0.0]
    return (
        f"haze above 0.15: {gain.median():+.2f} dB, {(gain > 0).float().mean():.0%} better, worst 5 % "
        f"{gain.quantile(0.05):+.1f} dB; haze off by {haze.median():.3f}; of clear pictures 95 % below "
        f"{clear.quantile(0.95):.2f}"
    )


if __name__ == "__main__":
    main()
