"""Tabulate the Gauss-Chebyshev rules of the gaps, and choose the order of each gap."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled_for_both
from adhesis.solver.sharp.gap.conformal_map import convergence_rate

Integers = NDArray[np.int64]


class GaussRules(NamedTuple):
    """Gauss-Chebyshev rules of all numbers of nodes M, end to end, for the compiled code.

    A gap's *order* is the index of its rule in ``counts``.

    Attributes
    ----------
    counts : int array
        The numbers of nodes M that a gap may have, rising.
    vector_start, matrix_start : int array
        Offset of the vectors and of the M×M matrices of each order.
    eta, weights : array
        Nodes and weights.
    end_values : array, shape (2, ·)
        f(-1) and f(+1) from the nodes' values.
    crack : array
        Matrices of a straight crack.
    modes : array
        U_n(η_i), rows nodes.
    """

    counts: Integers
    vector_start: Integers
    matrix_start: Integers
    eta: Array
    weights: Array
    end_values: Array
    crack: Array
    modes: Array


def _gauss_rules(counts: Integers) -> GaussRules:
    """Compute the rules of these numbers of nodes."""
    eta, weights, end_values, crack, modes = [], [], [], [], []
    for m in counts:
        t = np.arange(m, 0, -1) * np.pi / (m + 1)  # η increasing
        w = np.pi / (m + 1) * np.sin(t) ** 2
        n = np.arange(m)
        u = np.sin(np.outer(t, n + 1)) / np.sin(t)[:, None]
        to_modes = (2 / np.pi) * u * w[:, None]  # rows nodes, columns modes
        straight = (np.pi / 2) * (to_modes * (n + 1)) @ to_modes.T
        end = to_modes * (n + 1)
        eta.append(np.cos(t))
        weights.append(w)
        end_values.append(np.stack([end @ (-1.0) ** n, end.sum(axis=1)]))
        crack.append((straight + straight.T).ravel() / 2)
        modes.append(u.ravel())
    return GaussRules(
        counts=counts,
        vector_start=np.concatenate([[0], np.cumsum(counts)]),
        matrix_start=np.concatenate([[0], np.cumsum(counts**2)]),
        eta=np.concatenate(eta),
        weights=np.concatenate(weights),
        end_values=np.concatenate(end_values, axis=1),
        crack=np.concatenate(crack),
        modes=np.concatenate(modes),
    )


GAUSS_RULES = _gauss_rules(
    np.array([4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 16, 18, 20, 24, 28, 32, 40, 48, 64, 96, 128])
)


@compiled_for_both
def choose_orders(table: Array, digits: float, counts: Integers) -> Integers:
    """Choose the order of each gap whose modes leave an error of exp(-digits), or the largest."""
    orders = np.zeros(table.shape[0], dtype=np.int64)
    for k in range(table.shape[0]):
        wanted = digits / convergence_rate(table[k])
        while orders[k] < counts.shape[0] - 1 and counts[orders[k]] < wanted:
            orders[k] += 1
    return orders
