"""Compute the tension inside patches of one field, on equally spaced nodes or anywhere, refined.

S = S_full + p + |D| T is first taken on equally spaced nodes, eight or more to a shortest wave, by
Fourier transforms: the square roots of T at its edges leave an error there that falls as the
distance to the power -2, below a hundredth of the singular stress one wave away. It finds the local
maxima of tension; the largest of them are then verified and refined by :class:`RefinedTension`,

    S = S_full + p - (1/4π) ∫_gaps T(φ) / sin²((θ-φ)/2) dφ,

a Gauss-Chebyshev rule on the fine nodes, whose spacing at an end of the gap is far below that of
any output grid: it is exact to rounding.

``theta`` in the units of the field, tension in units of E*/2.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.peaks import highest_peaks, parabola_vertex
from adhesis.solver.sharp.field.gap_field import GapField, GapOpening
from adhesis.solver.sharp.tolerances import MOST_MAXIMA

_COARSE = 4.0  # sine nodes per shortest wave of the openings at nodes; the verification has more
_POINTS = 17  # points between the neighbours of a node at which its maximum is refined
_MOVES = 2  # steps of a node by which the maximum may lie beside the candidate


class RefinedTension:
    """Tension of one field at any position inside its patches."""

    def __init__(self, field: GapField, openings: list[GapOpening] | None = None) -> None:
        if openings is None:
            openings = [field.fine_opening(k) for k in range(len(field.gaps))]
        self._source, self._pressure = field.source, field.solution.pressure
        theta = np.concatenate([opening.theta for opening in openings])
        self._sine, self._cosine = np.sin(0.5 * theta), np.cos(0.5 * theta)
        self._source_weight = np.concatenate([o.opening * o.weight for o in openings])
        self._gaps = field.gaps

    def at(self, theta: Array) -> Array:
        """Compute the tension at some positions on the contact."""
        weight, sine, cosine = self._source_weight / (4 * np.pi), self._sine, self._cosine
        pull = [
            (weight / (s * cosine - c * sine) ** 2).sum()
            for s, c in zip(np.sin(0.5 * theta), np.cos(0.5 * theta), strict=True)
        ]
        return np.array(pull) - self._source.panels.stress(theta) - self._pressure

    def inside(self, theta: float) -> bool:
        """Return whether a position lies on the contact."""
        from_left = (theta - self._gaps[:, 0]) % (2 * np.pi)
        return bool((from_left > self._gaps[:, 1] - self._gaps[:, 0]).all())

    def edge_distance(self, theta: float) -> float:
        """Compute the distance of a position on the contact from the nearest edge."""
        to_right = (self._gaps[:, 0] - theta) % (2 * np.pi)
        to_left = (theta - self._gaps[:, 1]) % (2 * np.pi)
        return float(min(to_right.min(), to_left.min()))

    def maximum(self, theta: float, step: float) -> tuple[float, float] | None:
        """Locate a maximum within some steps of ``theta``: position and value; None without one."""
        for _ in range(_MOVES + 1):
            if not self.inside(theta) or self.edge_distance(theta) <= step:
                return None
            points = theta + step * np.linspace(-1, 1, _POINTS)
            values = self.at(points)
            i = int(values.argmax())
            if 0 < i < _POINTS - 1:
                shift, highest = parabola_vertex(*values[i - 1 : i + 2])
                return float(points[i] + shift * (points[1] - points[0])), highest
            theta = float(points[i])
        return None


class InnerTension:
    """Local maxima of tension inside patches, for the fields of one problem.

    They are searched on equally spaced nodes, eight or more to a shortest wave.
    """

    def __init__(self, problem: Problem) -> None:
        profile = problem.profile
        self._n = n = 1 << int(np.ceil(np.log2(8 * profile.highest_harmonic)))
        self._step = 2 * np.pi / n
        self._harmonic = harmonic = np.arange(n // 2 + 1)
        self._full = np.zeros(n // 2 + 1, dtype=np.complex128)  # S_full
        size = profile.highest_harmonic + 1
        self._full[:size] = harmonic[:size] * profile.coefficients[:size] * (profile.q0 * n)

    def maxima(self, field: GapField, least: float) -> list[tuple[float, float]]:
        """Find places and values of the maxima above ``least``; of many the largest ones."""
        nodes = highest_peaks(self._at_nodes(field), MOST_MAXIMA, least)
        if not nodes:
            return []
        refined = RefinedTension(field)
        found = (refined.maximum(node * self._step, self._step) for node in nodes)
        return [one for one in found if one]

    def _at_nodes(self, field: GapField) -> Array:
        """Compute the tension at the nodes, NaN outside contact."""
        n, step = self._n, self._step
        opening = np.zeros(n)
        free = []
        for k, (left, right) in enumerate(field.gaps):
            nodes = np.arange(int(np.floor(left / step)) + 1, int(np.ceil(right / step)))
            if not nodes.size:
                continue
            fine = field.fine_opening(k, _COARSE)
            x = nodes * step
            # over its square roots the opening is smooth up to both ends
            smooth = fine.opening / np.sqrt((fine.theta - left) * (right - fine.theta))
            value = np.interp(x, fine.theta, smooth) * np.sqrt((x - left) * (right - x))
            nodes %= n
            opening[nodes] = value
            free.append(nodes)
        relief = np.fft.rfft(opening)
        relief *= self._harmonic
        relief += self._full
        tension = -(np.fft.irfft(relief, n) + field.solution.pressure)
        for nodes in free:
            tension[nodes] = np.nan
        return tension
