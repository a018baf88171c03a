"""Map a gap to the coordinate in which its neighbours are far away.

The half-space kernel dθ dθ'/(θ-θ')² keeps its form under every Möbius map. For a gap (l, r) between
patches whose far sides are A < l and B > r, take

    η = [ln((θ-A)/(B-θ)) - middle] / (2α),      η(l) = -1, η(r) = +1,

in which it becomes α²/sinh²(α(η-η')) dη dη', while every other gap, and every periodic image, lies
on the line Im η = π/(2α). However narrow the patches, α grows only as half the logarithm of gap
over patch, and Chebyshev series in η converge as ρ^-M with ρ = τ + sqrt(1 + τ²), τ = π/(2α).
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both, compiled_sums

# Columns of the table of gaps.
LEFT, RIGHT, LEFT_PATCH, RIGHT_PATCH, ALPHA = 0, 1, 2, 3, 4
_COLUMNS = 5

_PER_UNIT = 32  # entries of the table of exp(y) - 1 for a unit of y
# y is at most the α of a gap, twice: below 40, as patches are wider than rounding
_EXPM1 = np.expm1(np.arange(40 * _PER_UNIT) / _PER_UNIT)


@compiled_for_both
def map_gaps(gaps: Array) -> Array:
    """Make the table of gaps, shape (L, 5): both ends, widths of the patches beside them, α.

    ``gaps`` holds the ends in θ, shape (L, 2), increasing, within one period.
    """
    count = gaps.shape[0]
    table = np.empty((count, _COLUMNS))
    for k in range(count):
        before = gaps[k - 1, 1] if k > 0 else gaps[count - 1, 1] - 2 * np.pi
        after = gaps[k + 1, 0] if k + 1 < count else gaps[0, 0] + 2 * np.pi
        length = gaps[k, 1] - gaps[k, 0]
        left = gaps[k, 0] - before
        right = after - gaps[k, 1]
        table[k, LEFT] = gaps[k, 0]
        table[k, RIGHT] = gaps[k, 1]
        table[k, LEFT_PATCH] = left
        table[k, RIGHT_PATCH] = right
        table[k, ALPHA] = 0.25 * (np.log1p(length / left) + np.log1p(length / right))
    return table


@compiled
def in_order(table: Array) -> bool:
    """Return whether every gap and patch has a length; False if an edge is NaN."""
    for k in range(table.shape[0]):
        # written so that NaN fails
        length = table[k, RIGHT] - table[k, LEFT]
        if not (length > 0 and table[k, LEFT_PATCH] > 0 and table[k, RIGHT_PATCH] > 0):
            return False
    return True


@compiled
def pole_distances(gap: Array, side: int) -> tuple[float, float]:
    """Return the distances of an end from both poles of the map: beside it, and at the far side."""
    if side == 0:
        return gap[LEFT_PATCH], gap[RIGHT] - gap[LEFT] + gap[RIGHT_PATCH]
    return gap[RIGHT_PATCH], gap[RIGHT] - gap[LEFT] + gap[LEFT_PATCH]


@compiled
def log_ratio(r: float, near: float, far: float) -> float:
    """Take the logarithm of the map at the distance r from an end; see :func:`pole_distances`."""
    value: float = np.log1p(r * (1 / near + 1 / far) / (1 - r / far))
    return value


@compiled
def one_minus_plus(gap: Array, r: float, side: int) -> tuple[float, float]:
    """Compute (1 - η, 1 + η) at the distance r from the left (side 0) or right end, to rounding."""
    near, far = pole_distances(gap, side)
    distance = log_ratio(r, near, far) / (2 * gap[ALPHA])
    if side == 0:
        return 2 - distance, distance
    return distance, 2 - distance


@compiled
def eta_from(minus: float, plus: float) -> float:
    """Compute η from 1 - η and 1 + η, by the smaller of them."""
    return plus - 1 if plus < minus else 1 - minus


@compiled
def eta_at(gap: Array, theta: float) -> tuple[float, float, float]:
    """Compute η, 1 - η² and dη/dθ at θ, measured from the nearer end."""
    side = 0 if theta - gap[LEFT] < gap[RIGHT] - theta else 1
    r = theta - gap[LEFT] if side == 0 else gap[RIGHT] - theta
    minus, plus = one_minus_plus(gap, r, side)
    near, far = pole_distances(gap, side)
    slope = (1 / (near + r) + 1 / (far - r)) / (2 * gap[ALPHA])
    return eta_from(minus, plus), minus * plus, slope


@compiled
def theta_at(gap: Array, eta: float) -> tuple[float, float]:
    """Compute θ and dθ/dη at η, measured from the nearer end."""
    side = 0 if eta < 0 else 1
    near, far = pole_distances(gap, side)
    grown = np.expm1(2 * gap[ALPHA] * (1 + eta if side == 0 else 1 - eta))
    r = grown / (1 / near + (1 + grown) / far)  # distance from the nearer end
    stretch = 2 * gap[ALPHA] / (1 / (near + r) + 1 / (far - r))
    return (gap[LEFT] + r if side == 0 else gap[RIGHT] - r), stretch


@compiled_sums
def place_nodes(gap: Array, cosine: Array, sine: Array, theta: Array, theta_by_t: Array) -> None:
    """Compute θ and dθ/dt at nodes η = cos t, t rising, as many as ``theta`` holds.

    As :func:`theta_at`, many at a time, with exp(y) - 1 from a table.
    """
    alpha = 2 * gap[ALPHA]
    middle = (theta.shape[0] + 1) // 2  # nodes up to it are measured from the right end
    for side in range(2):
        near, far = pole_distances(gap, side)
        inwards = 1.0 - 2 * side
        for i in range(0 if side == 1 else middle, middle if side == 1 else theta.shape[0]):
            y = alpha * (1 + inwards * cosine[i])
            entry = int(y * _PER_UNIT)
            x = y - entry / _PER_UNIT
            grown = 1 / 24 + x * (1 / 120 + x * (1 / 720 + x / 5040))
            grown = x * (1 + x * (0.5 + x * (1 / 6 + x * grown)))
            grown = _EXPM1[entry] + grown * (1 + _EXPM1[entry])
            r = grown * near * far / (far + (1 + grown) * near)
            theta_by_t[i] = alpha * (near + r) * (far - r) / (near + far) * sine[i]
            theta[i] = gap[LEFT + side] + inwards * r


@compiled
def convergence_rate(gap: Array) -> float:
    """Return the rate ln ρ of a gap: the error of M modes falls as ρ^-M."""
    rate: float = np.arcsinh(np.pi / (2 * gap[ALPHA]))
    return rate
