"""Gauss-Chebyshev rules of the gaps: how many values carry a gap's opening, and where."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled_for_both
from adhesis.solver.sharp.gap.conformal_map import convergence

Kinds = NDArray[np.int64]
"""One whole number a gap: its kind of rule, or its first node."""


class Rules(NamedTuple):
    """Gauss-Chebyshev rules of all mode counts M, end to end, for the compiled code.

    Attributes
    ----------
    counts : int array
        The numbers of nodes M that a gap may have; a gap's "kind" is its place here.
    start, square : int array
        Offset of the vectors and of the M×M matrices of each kind.
    eta, w : array
        Nodes and weights.
    ends : array, shape (2, ·)
        f(-1) and f(+1) from the nodes' values.
    b : array
        The straight crack.
    modes : array
        U_n(η_i), rows nodes.
    """

    counts: NDArray[np.int64]
    start: NDArray[np.int64]
    square: NDArray[np.int64]
    eta: Array
    w: Array
    ends: Array
    b: Array
    modes: Array


def _rules(counts: NDArray[np.int64]) -> Rules:
    eta, weight, ends, b, modes = [], [], [], [], []
    for m in counts:
        t = np.arange(m, 0, -1) * np.pi / (m + 1)  # η increasing
        w = np.pi / (m + 1) * np.sin(t) ** 2
        n = np.arange(m)
        u = np.sin(np.outer(t, n + 1)) / np.sin(t)[:, None]
        to_modes = (2 / np.pi) * u * w[:, None]  # rows nodes, columns modes
        straight = (np.pi / 2) * (to_modes * (n + 1)) @ to_modes.T
        end = to_modes * (n + 1)
        eta.append(np.cos(t))
        weight.append(w)
        ends.append(np.stack([end @ (-1.0) ** n, end.sum(axis=1)]))
        b.append((straight + straight.T).ravel() / 2)
        modes.append(u.ravel())
    return Rules(
        counts,
        np.concatenate([[0], np.cumsum(counts)]),
        np.concatenate([[0], np.cumsum(counts**2)]),
        np.concatenate(eta),
        np.concatenate(weight),
        np.concatenate(ends, axis=1),
        np.concatenate(b),
        np.concatenate(modes),
    )


RULES = _rules(
    np.array([4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 16, 18, 20, 24, 28, 32, 40, 48, 64, 96, 128])
)


@compiled_for_both
def choose_kinds(table: Array, digits: float, counts: Kinds) -> Kinds:
    """Kind of each gap whose modes leave an error of exp(-digits), or the largest kind."""
    kinds = np.zeros(table.shape[0], dtype=np.int64)
    for k in range(table.shape[0]):
        wanted = digits / convergence(table[k])
        while kinds[k] < counts.shape[0] - 1 and counts[kinds[k]] < wanted:
            kinds[k] += 1
    return kinds
