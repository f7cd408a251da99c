"""Linear motion under white noise, over any time: x' = A x + w, with w of density W."""

from __future__ import annotations

import numpy as np

from landtool.geometry import Array

_TERMS = 12


def over(A: Array, W: Array, dt_s: float) -> tuple[Array, Array]:
    """Return F (n, n) and Q (n, n) over `dt_s` of A (n, n) and W (n, n); the formula is van Loan's.

    C. van Loan: Computing integrals involving the matrix exponential, IEEE Trans. Automatic Control 23 (1978).
    """
    n = len(A)
    fastest = float(np.abs(A).sum(axis=1).max())
    doublings = max(0, int(np.ceil(np.log2(max(fastest * dt_s * 8.0, 1.0)))))
    part_s = dt_s / 2.0**doublings
    # exp([[-A, W], [0, A^T]] dt) = [[., F^-1 Q], [0, F^T]]
    both = _exponential(np.block([[-A, W], [np.zeros((n, n)), A.T]]) * part_s)
    F = both[n:, n:].T
    Q = F @ both[:n, n:]
    # in doubled steps, because F^-1 of a long one has no bound where the motion forgets
    for _ in range(doublings):
        Q = Q + F @ Q @ F.T
        F = F @ F
    return F, 0.5 * (Q + Q.T)


def _exponential(small: Array) -> Array:
    """Return exp(small) by Taylor's series."""
    total = term = np.eye(len(small))
    for k in range(1, _TERMS):
        term = term @ small / k
        total = total + term
    return total
