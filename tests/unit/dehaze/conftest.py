from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest


@pytest.fixture(scope="module")
def strict() -> Iterator[None]:
    """Every exception of arithmetic is an error."""
    with np.errstate(all="raise"):
        yield
