from __future__ import annotations

import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.pad import PadSpec
from landtool.synth.ground import Ground, ground_below, make_ground, render_ground, render_scene, value_noise
from landtool.synth.looks import LOOKS, GroundKind
from landtool.synth.render import render_pad
from tests.unit.synth.brute import BARREL, PINHOLE, looking_down

PAD = PadSpec()
SMALL = PINHOLE.scaled(160, 120)


@pytest.fixture(scope="module")
def concrete() -> Ground:
    return make_ground("concrete", np.random.default_rng(1))


def test_noise_tiles_and_is_normalised() -> None:
    noise = value_noise(256, 4, 0.5, np.random.default_rng(0))
    assert noise.mean() == pytest.approx(0.0, abs=1e-5)
    assert noise.std() == pytest.approx(1.0, abs=1e-5)
    inner = np.abs(np.diff(noise, axis=0)).mean()
    across = np.abs(noise[0] - noise[-1]).mean()
    assert across < 1.5 * inner


@pytest.mark.parametrize("kind", LOOKS)
def test_a_ground_is_its_generators_and_keeps_its_light_at_every_height(kind: GroundKind) -> None:
    ground = make_ground(kind, np.random.default_rng(4))
    same, other = make_ground(kind, np.random.default_rng(4)), make_ground(kind, np.random.default_rng(5))
    pose = looking_down(3.0)
    picture = render_ground(SMALL, pose, ground)
    np.testing.assert_array_equal(picture, render_ground(SMALL, pose, same))
    assert np.abs(picture - render_ground(SMALL, pose, other)).mean() > 0.003
    assert picture.min() > 0.0
    assert picture.max() < 1.0
    means = [render_ground(SMALL, looking_down(z), ground).mean(axis=(0, 1)) for z in (6.0, 25.0, 60.0)]
    for mean in means:
        np.testing.assert_allclose(mean, means[0], rtol=0.15)
    # far away the grain averages out, it does not flicker
    assert render_ground(SMALL, looking_down(60.0), ground).std() < picture.std() + 0.02


def test_the_ground_moves_with_the_scene(concrete: Ground) -> None:
    z = 3.0
    here = render_ground(PINHOLE, looking_down(z), concrete)
    there = render_ground(PINHOLE, looking_down(z, 5.0 * z / PINHOLE.fx, 0.0), concrete)
    np.testing.assert_allclose(there[:, 5:], here[:, :-5], atol=1e-3)
    assert np.abs(there - here).mean() > 0.001


def test_the_scene_is_the_pad_over_its_ground(concrete: Ground) -> None:
    pose = looking_down(4.0, 0.3, 0.1, (0.2, 0.1, 0.5))
    below = ground_below(pose, 0.4)
    np.testing.assert_allclose(pose.inverse().apply(below.translation), [0.0, 0.0, -0.4], atol=1e-12)
    scene = render_scene(BARREL, pose, PAD, concrete, camera_T_ground=below, light=0.8)
    ground = 0.8 * render_ground(BARREL, below, concrete)
    np.testing.assert_allclose(scene, render_pad(BARREL, pose, PAD, background=ground, light=0.8), atol=1e-6)


def test_above_the_horizon_is_sky(concrete: Ground) -> None:
    # level, 2 m above it: the horizon is the row of the principal point, 59.5
    image = render_ground(SMALL, looking_down(0.0, 0.0, 2.0, (-np.pi / 2.0, 0.0, 0.0)), concrete)
    sky, ground = image[:59], image[61:]
    assert (sky == sky[0, 0]).all()
    assert (np.abs(ground - sky[0, 0]).max(axis=2) > 0.1).all()
    assert len(np.unique(ground[:, :, 0])) > 100


def test_an_unknown_ground_is_refused() -> None:
    with pytest.raises(UsageError, match="lava"):
        make_ground("lava", np.random.default_rng(0))  # type: ignore[arg-type]
