"""The elastic field of given contact edges: every gap is a crack in a full contact.

Full contact carries the stress σ_full; the gaps relieve it. With θ = q0 x, S = 2σ/E*, T = q0 t (gap
opening) and |D| the operator with symbol |m|,

    S = S_full + p + |D| T,      S = 0 in the gaps,  T = 0 on the contact,  mean(T) = q0 s,

p = 2p̄/E* the mean stress. In the coordinate η of each gap (:mod:`solver.sharp_map`)
T = sqrt(1-η²) f(η) closes at both ends by construction, the straight-crack part of |D| is diagonal
in the Chebyshev polynomials U_n(η), and what remains is smooth. So a few values of f per gap carry
it all, at the M second-kind Gauss-Chebyshev nodes of each gap:

    (B + G) f = -(S~ + p X),     Xᵀ f = 2π q0 s,                                     (1)

with quadrature weights w, X = w dθ/dη, B the straight crack (the same for every gap of M nodes),
G_ij = -X_i X_j/(4π sin²(Δθ/2)) between gaps and, in the own gap, the same less the straight crack,
-(w_i w_j/π)[α²/sinh²(α Δη) - 1/Δη²] - (X_i X_j/4π)[1/sin²(Δθ/2) - 4/Δθ²];
the matrix is symmetric positive definite, being the elastic energy of the openings. S~ is S_full
projected on the first M modes; its higher modes meet no smooth kernel and act as in a single
straight crack, so their share of the edge opening is known in closed form. The error is spectral in
M and hardly depends on how narrow the patches are.

At an edge T ≈ C sqrt(r), r the distance from the edge in θ, and

    C = sqrt(2 dη/dθ) [f(±1) - (s^± - Σ_{n<M} (±1)^n s_n)],      K = (E*/4) C sqrt(2π/q0) / q0^0,
    G = K²/(2E*) = π E* C² / (16 q0).

The derivative of the field with respect to an edge is the homogeneous solution with an opening
∝ 1/sqrt(r) there (Bueckner's and Rice's weight function); the diagonal follows from translation
invariance: moving all edges together is moving the profile, whose source is S_full'.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotrs

from solver.compiled import compiled
from solver.profile import Array
from solver.sharp_map import ALPHA, LEFT, RIGHT, convergence, map_gaps, theta_at
from solver.sharp_source import StressSource, gap_moments

MODE_COUNTS = np.array([6, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 64, 96, 128], dtype=np.int64)
"""Numbers of nodes M a gap may have."""


@dataclass(frozen=True)
class _Tables:
    """Rules of all mode counts, end to end, for the compiled code.

    ``start`` and ``square`` are offsets of vectors and matrices; ``eta`` and ``w`` nodes and
    weights; ``ends`` f(-1) and f(+1) from the nodes' values; ``b`` the straight crack; ``modes``
    U_n(η_i), rows nodes.
    """

    start: NDArray[np.int64]
    square: NDArray[np.int64]
    eta: Array
    w: Array
    ends: Array
    b: Array
    modes: Array


def _tables() -> _Tables:
    eta, weight, ends, b, modes = [], [], [], [], []
    for m in MODE_COUNTS:
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
    return _Tables(
        np.concatenate([[0], np.cumsum(MODE_COUNTS)]),
        np.concatenate([[0], np.cumsum(MODE_COUNTS**2)]),
        np.concatenate(eta),
        np.concatenate(weight),
        np.concatenate(ends, axis=1),
        np.concatenate(b),
        np.concatenate(modes),
    )


TABLES = _tables()


class GapField:
    """Solution of (1) for given gap ends.

    Parameters
    ----------
    source : StressSource
    gaps : array, shape (L, 2)
        Left and right end of each gap in θ: increasing, the last right end below
        gaps[0, 0] + 2π.
    separation : float
        q0 s.
    tolerance : float
        Wanted relative accuracy of the interaction between gaps.

    kinds : int array, shape (L,), optional
        Places in MODE_COUNTS, instead of those that the tolerance asks for. An iteration must keep
        them: where they change, the field jumps by its error.

    Attributes
    ----------
    opening : array, shape (L, 2)
        C at each gap end.
    pressure : float
        p = 2p̄/E*.
    """

    def __init__(
        self,
        source: StressSource,
        gaps: Array,
        separation: float,
        tolerance: float,
        kinds: NDArray[np.intp] | None = None,
    ) -> None:
        self.source, self.gaps, self.separation = source, gaps, separation
        self.table = map_gaps(gaps)
        if kinds is None:
            wanted = -np.log(tolerance) / convergence(self.table)
            kinds = np.minimum(np.searchsorted(MODE_COUNTS, wanted), len(MODE_COUNTS) - 1)
        self.kinds = kinds
        self.offset = np.concatenate([[0], np.cumsum(MODE_COUNTS[self.kinds])])
        self.theta, self.weight, self._slope, self._matrix, self.rhs, self._beyond, self.s = (
            assemble(
                self.table, self.kinds, self.offset, MODE_COUNTS,
                TABLES.start, TABLES.square, TABLES.eta, TABLES.w, TABLES.b, TABLES.modes,
                source.width, source.panels, source.x, source.w, source.coefficients,
                source.weights, source.level_start, source.end_x, source.end_w,
                2,
            )
        )  # fmt: skip
        # The matrix is symmetric, so its transpose is Fortran order without a copy.
        self._factor, info = dpotrf(self._matrix.T, lower=1, clean=0, overwrite_a=0)
        if info:
            raise FloatingPointError("the matrix of the gaps is not positive definite")
        self._solved, _ = dpotrs(self._factor, self.rhs, lower=1)
        unit = self._solved[:, 1]
        self._unit_mean = float(self.weight @ unit)
        self.pressure = (
            -(2 * np.pi * separation + float(self.weight @ self._solved[:, 0])) / self._unit_mean
        )
        self.f = -self._solved[:, 0] - self.pressure * unit
        self.opening = self._at_ends(self.f, 0)

    def _at_ends(self, f: Array, field: int | None) -> Array:
        """C at each gap end of the density f, with the high modes of S (0), S' (1) or none."""
        out = edge_openings(
            f[:, None], self._slope, self.kinds, self.offset, TABLES.start, TABLES.ends
        )
        result: Array = out[:, 0].reshape(-1, 2)
        if field is not None:
            result = result - np.sqrt(2 * self._slope) * self._beyond[:, :, field]
        return result

    def _regular(self, f: Array) -> Array:
        """C of regular densities, shape (2L, columns), from their columns of nodal values."""
        out: Array = edge_openings(
            f, self._slope, self.kinds, self.offset, TABLES.start, TABLES.ends
        )
        return out

    @cached_property
    def pressure_by_separation(self) -> float:
        """∂p/∂(q0 s) at fixed edges; negative."""
        return float(-2 * np.pi / self._unit_mean)

    @cached_property
    def opening_by_separation(self) -> Array:
        """∂C/∂(q0 s) at fixed edges, shape (L, 2)."""
        return self._at_ends(-self.pressure_by_separation * self._solved[:, 1], None)

    @cached_property
    def derivatives(self) -> tuple[Array, Array]:
        """∂C_e/∂θ_f, shape (2L, 2L), and ∂p/∂θ_f, shape (2L,), at fixed separation.

        Edges in the order of ``gaps.ravel()``; θ_f grows to the right.
        """
        load, area = _singular_loads(
            self.table, self._slope, self.kinds, self.offset, MODE_COUNTS, TABLES.start,
            TABLES.square, TABLES.eta, TABLES.b, self.theta, self.weight, self._matrix, TABLES.w,
        )  # fmt: skip
        y, _ = dpotrs(self._factor, load, lower=1)
        slope = self._slope.ravel()
        side = np.tile([-1.0, 1.0], len(self.gaps))
        p = (area + self.weight @ y) / self._unit_mean
        y -= np.outer(self._solved[:, 1], p)
        by_edge: Array = edge_openings(
            y, self._slope, self.kinds, self.offset, TABLES.start, TABLES.ends
        )
        k = np.arange(len(slope))
        by_edge[k ^ 1, k] += 0.5 * np.sqrt(2 * slope[k ^ 1])  # the singular opening's far end
        strength = side * self.opening.ravel() * np.sqrt(slope / 8)
        by_edge *= strength
        # Translation: all edges together against the profile.
        drift = -float(self.weight @ self._solved[:, 2]) / self._unit_mean
        moved = self._at_ends(-self._solved[:, 2] - drift * self._solved[:, 1], 1).ravel()
        by_edge[k, k] = 0.0
        by_edge[k, k] = moved - by_edge.sum(axis=1)
        return by_edge, p * strength


@compiled
def _periodic(x):  # type: ignore[no-untyped-def]  # compiled
    """1/sin²(x/2) - 4/x², x = Δθ: what the own gap feels of its periodic images."""
    if abs(x) < 0.2:
        y = x * x
        return 1 / 3 + y * (1 / 60 + y * (1 / 1512 + y * (1 / 43200 + y / 1330560)))
    half = np.sin(0.5 * x)
    return 1 / (half * half) - 4 / (x * x)


@compiled
def _mapped(alpha, x):  # type: ignore[no-untyped-def]  # compiled
    """4 [α²/sinh²(αx) - 1/x²], x = Δη: the own gap's kernel beyond a straight crack in η."""
    y = alpha * x
    if abs(y) < 0.3:
        y *= y
        series = -1 / 3 + y * (1 / 15 + y * (-2 / 189 + y * (1 / 675 - y * 2 / 10395)))
        return 4 * alpha * alpha * series
    return 4 * ((alpha / np.sinh(y)) ** 2 - 1 / (x * x))


@compiled
def assemble(  # type: ignore[no-untyped-def]  # compiled
    table, kinds, offset, counts, start, square, eta, w, b, modes,
    width, panels, node_x, node_w, coefficients, weights, level_start, end_x, end_w, fields,
):  # fmt: skip
    """Matrix and right-hand sides of (1), with S alone (fields = 1) or S and S' (2).

    Returns θ and X of the nodes, dη/dθ at the ends, matrix, right-hand sides (S~, X, S~'), what the
    higher modes add at the ends, and the moments.
    """
    gaps_n = table.shape[0]
    n = offset[gaps_n]
    theta = np.empty(n)
    weight = np.empty(n)  # dθ/dη times the weight of the rule
    slope = np.empty((gaps_n, 2))  # dη/dθ at the ends
    rhs = np.empty((fields + 1, n))  # S~, the unit pressure and, last, S~'
    beyond = np.empty((gaps_n, 2, fields))
    all_s = np.zeros((n, fields))
    matrix = np.empty((n, n))
    for k in range(gaps_n):
        m = counts[kinds[k]]
        gap = table[k]
        slope[k, 0] = 1 / theta_at(gap, -1.0)[1]
        slope[k, 1] = 1 / theta_at(gap, 1.0)[1]
        s = all_s[offset[k] : offset[k] + m]
        ends = np.zeros((2, fields))
        gap_moments(
            gap, width, panels, node_x, node_w, coefficients, weights, level_start, end_x, end_w,
            s, ends,
        )  # fmt: skip
        for field in range(fields):
            low = 0.0
            high = 0.0
            sign = 1.0
            for j in range(m):
                high += s[j, field]
                low += sign * s[j, field]
                sign = -sign
            beyond[k, 0, field] = ends[0, field] - low
            beyond[k, 1, field] = ends[1, field] - high
        for i in range(m):
            row = offset[k] + i
            place = start[kinds[k]] + i
            theta[row], stretch = theta_at(gap, eta[place])
            weight[row] = w[place] * stretch
            rhs[1, row] = weight[row]
            for field in range(fields):
                total = 0.0
                for j in range(m):
                    total += modes[square[kinds[k]] + i * m + j] * s[j, field]
                rhs[2 * field, row] = w[place] * total
            for j in range(i + 1):
                other = start[kinds[k]] + j
                value = b[square[kinds[k]] + i * m + j]
                value -= (
                    w[place] * w[other] * _mapped(gap[ALPHA], eta[place] - eta[other])
                    + weight[row]
                    * weight[offset[k] + j]
                    * _periodic(theta[row] - theta[offset[k] + j])
                ) / (4 * np.pi)
                matrix[row, offset[k] + j] = value
                matrix[offset[k] + j, row] = value
    sine = np.sin(0.5 * theta)
    cosine = np.cos(0.5 * theta)
    for k in range(1, gaps_n):
        for i in range(offset[k], offset[k + 1]):
            scale = -weight[i] / (4 * np.pi)
            for j in range(offset[k]):
                half = sine[i] * cosine[j] - cosine[i] * sine[j]
                matrix[i, j] = scale * weight[j] / (half * half)
            for j in range(offset[k]):
                matrix[j, i] = matrix[i, j]
    return theta, weight, slope, matrix, rhs.T, beyond, all_s


@compiled
def edge_openings(f, slope, kinds, offset, start, ends):  # type: ignore[no-untyped-def]  # compiled
    """sqrt(2 dη/dθ) f(±1) at every gap end for each column of f, shape (2L, columns)."""
    out = np.zeros((2 * slope.shape[0], f.shape[1]))
    for k in range(slope.shape[0]):
        for side in range(2):
            scale = np.sqrt(2 * slope[k, side])
            for i in range(offset[k + 1] - offset[k]):
                factor = scale * ends[side, start[kinds[k]] + i]
                for j in range(f.shape[1]):
                    out[2 * k + side, j] += factor * f[offset[k] + i, j]
    return out


@compiled
def _singular_loads(  # type: ignore[no-untyped-def]  # compiled
    table, slope, kinds, offset, counts, start, square, eta, b, theta, weight, matrix, w
):  # fmt: skip
    """Right-hand sides of the regular part of the solution singular at each edge, and its area.

    The opening sqrt((1∓η)/(1±η)) of the own gap has the density 1/(1±η) at the nodes and, as the
    rule is exact for polynomials only, a further weight π/(M+1) at the edge itself.
    """
    n = theta.shape[0]
    gaps_n = table.shape[0]
    load = np.empty((2 * gaps_n, n))
    area = np.empty(2 * gaps_n)
    for k in range(gaps_n):
        m = counts[kinds[k]]
        base = offset[k]
        for side in range(2):
            f = 2 * k + side
            q = np.empty(m)
            for j in range(m):
                x = eta[start[kinds[k]] + j]
                q[j] = 1 / (1 + x) if side == 0 else 1 / (1 - x)
            edge = table[k, LEFT] if side == 0 else table[k, RIGHT]
            edge_eta = -1.0 if side == 0 else 1.0
            point = np.pi / (m + 1)
            area[f] = point / slope[k, side]
            for j in range(m):
                area[f] += weight[base + j] * q[j]
            for i in range(n):
                total = 0.0
                if base <= i < base + m:
                    for j in range(m):
                        total -= (
                            matrix[i, base + j] - b[square[kinds[k]] + (i - base) * m + j]
                        ) * q[j]
                    place = start[kinds[k]] + i - base
                    total += (
                        w[place] * point * _mapped(table[k, ALPHA], eta[place] - edge_eta)
                        + weight[i] * point / slope[k, side] * _periodic(theta[i] - edge)
                    ) / (4 * np.pi)
                else:
                    for j in range(m):
                        total -= matrix[i, base + j] * q[j]
                    half = np.sin(0.5 * (theta[i] - edge))
                    total += weight[i] * point / slope[k, side] / (4 * np.pi * half * half)
                load[f, i] = total
    return load.T, area
