from __future__ import annotations

import numpy as np
import pytest

from landtool.dehaze import matting
from landtool.dehaze.matting import matting_laplacian, soft_matting
from landtool.errors import InputError

SHAPES = [(1, 1), (1, 9), (9, 1), (2, 2), (2, 7), (7, 2), (3, 3), (4, 4), (6, 3), (12, 15)]


@pytest.mark.parametrize("shape", SHAPES)
def test_the_laplacian_is_symmetric_and_an_even_map_costs_nothing(shape: tuple[int, int]) -> None:
    image = np.random.default_rng(1).integers(0, 256, shape + (3,), np.uint8)
    dense = matting_laplacian(image, 1e-4).toarray()
    np.testing.assert_allclose(dense, dense.T, atol=1e-12)
    np.testing.assert_allclose(dense.sum(axis=1), 0.0, atol=1e-9)
    assert np.linalg.eigvalsh(dense).min() > -1e-9


@pytest.mark.parametrize("epsilon", [1e-7, 1e-3])
@pytest.mark.parametrize("shape", [(3, 3), (4, 4), (6, 3), (12, 15)])
def test_the_laplacian_is_the_one_of_pymatting(shape: tuple[int, int], epsilon: float) -> None:
    pymatting = pytest.importorskip("pymatting", reason="pymatting is not installed")
    image = np.random.default_rng(2).integers(0, 256, shape + (3,), np.uint8)
    theirs = pymatting.cf_laplacian(image / 255.0, epsilon=epsilon).toarray()
    np.testing.assert_allclose(matting_laplacian(image, epsilon).toarray(), theirs, atol=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_solution_solves_the_system(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(3)
    image, before = rng.integers(0, 256, shape + (3,), np.uint8), rng.random(shape, np.float32)
    system = matting_laplacian(image, 1e-7).toarray() + 1e-2 * np.eye(before.size)
    exact = np.linalg.solve(system, 1e-2 * before.ravel().astype(float)).reshape(shape)
    with np.errstate(all="raise"):
        np.testing.assert_allclose(soft_matting(image, before, 1e-2), exact, atol=1e-3)


def test_a_map_gets_the_edge_of_the_picture() -> None:
    image = np.full((20, 30, 3), 60, np.uint8)
    image[:, 15:] = 200
    image += np.random.default_rng(4).integers(0, 3, image.shape, np.uint8)
    before = np.full((20, 30), 0.2, np.float32)
    before[:, 12:] = 0.8  # three pixels off
    made = soft_matting(image, before, 1e-4)
    assert abs(made[:, 14] - made[:, 15]).min() > 0.3
    assert abs(made[:, 11] - made[:, 12]).max() < 0.1


@pytest.mark.parametrize("grey", [0, 128, 255])
def test_an_even_picture_is_solved(grey: int) -> None:
    with np.errstate(all="raise"):
        made = soft_matting(np.full((3, 500, 3), grey, np.uint8), np.full((3, 500), 0.4, np.float32), 1e-4)
    np.testing.assert_allclose(made, 0.4, atol=1e-3)


def test_a_system_that_does_not_converge_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matting, "_MOST_ITERATIONS", 2)
    rng = np.random.default_rng(5)
    with pytest.raises(InputError, match="does not converge; raise matting_lambda"):
        soft_matting(rng.integers(0, 256, (20, 20, 3), np.uint8), rng.random((20, 20), np.float32), 1e-4)
