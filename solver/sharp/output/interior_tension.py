"""Largest tension inside patches, away from their edges.

S = S_full + p + |D| T is first taken on equally spaced nodes, eight to a shortest wave, by Fourier
transforms: the square roots of T at its edges leave an error there that falls as the distance to
the power -2, below a hundredth of the singular stress one wave away. It finds the local maxima of
tension; the largest of them are then verified and refined by the quadrature of
``grid_fields``, which is exact to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.method import PatchTension
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.peaks import highest_peaks
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.field.opening_series import GapOpening, fine_opening

_PER_WAVE = 8  # nodes per shortest wave, at least
_COARSE = 4.0  # sine nodes per shortest wave of the openings at nodes; the verification has more
_CANDIDATES = 4  # local maxima of each state that are kept
_POINTS = 17  # places between the neighbours of a node at which its maximum is refined
_MOVES = 2  # steps of a node by which the maximum may lie beside the candidate


class _Refined:
    """Tension of one field at any places inside its patches.

    ``theta`` in the units of the field, tension in units of E*/2.
    """

    def __init__(self, field: GapField, openings: list[GapOpening]) -> None:
        self._source, self._pressure = field.source, field.pressure
        theta = np.concatenate([opening.theta for opening in openings])
        self._sine, self._cosine = np.sin(0.5 * theta), np.cos(0.5 * theta)
        self._strength = np.concatenate([o.opening * o.weight for o in openings]) / (4 * np.pi)
        self._gaps = field.gaps

    def at(self, theta: Array) -> Array:
        """Tension at some places."""
        half = np.outer(np.sin(0.5 * theta), self._cosine)
        half -= np.outer(np.cos(0.5 * theta), self._sine)
        np.square(half, out=half)
        pull = np.reciprocal(half, out=half) @ self._strength
        return np.asarray(pull - self._source.sample(theta)[:, 0] - self._pressure)

    def inside(self, theta: float) -> bool:
        """Whether a place lies on the contact."""
        from_left = (theta - self._gaps[:, 0]) % (2 * np.pi)
        return bool((from_left > self._gaps[:, 1] - self._gaps[:, 0]).all())

    def maximum(self, theta: float, step: float) -> tuple[float, float] | None:
        """Place and value of a local maximum within some steps of ``theta``; None without one."""
        for _ in range(_MOVES + 1):
            if not (self.inside(theta - step) and self.inside(theta + step)):
                return None
            places = theta + step * np.linspace(-1, 1, _POINTS)
            values = self.at(places)
            i = int(values.argmax())
            if 0 < i < _POINTS - 1:
                before, here, after = values[i - 1 : i + 2]
                bend = before - 2 * here + after
                shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
                return (
                    float(places[i] + shift * (places[1] - places[0])),
                    float(here - 0.25 * (before - after) * shift),
                )
            theta = float(places[i])
        return None


def largest_tension(
    problem: Problem, field_of: Callable[[int], GapField], count: int
) -> PatchTension | None:
    """Find the largest local maximum of tension inside the patches of some states.

    Parameters
    ----------
    problem : Problem
    field_of : callable
        Gives the field of each state by its number.
    count : int
        Number of states.
    """
    profile = problem.profile
    n = 1 << int(np.ceil(np.log2(_PER_WAVE * profile.highest_harmonic)))
    step = 2 * np.pi / n
    harmonic = np.arange(n // 2 + 1)
    full = np.zeros(n // 2 + 1, dtype=np.complex128)  # S_full
    size = profile.highest_harmonic + 1
    full[:size] = harmonic[:size] * profile.coefficients[:size] * (profile.q0 * n)

    @lru_cache(maxsize=1)
    def refined(state: int) -> _Refined:
        field = field_of(state)
        return _Refined(field, [fine_opening(field, k) for k in range(len(field.gaps))])

    candidates: list[tuple[float, int, int]] = []  # tension, state, node
    for state in range(count):
        tension = _at_nodes(field_of(state), full, harmonic, n)
        nodes = highest_peaks(tension, _CANDIDATES)
        candidates += [(float(tension[node]), state, node) for node in nodes]
    candidates.sort(key=lambda entry: -entry[0])
    best: PatchTension | None = None
    unit = problem.half_space.modulus / 2
    for value, state, node in candidates:
        if best is not None and value * unit <= best.tension:
            break
        found = refined(state).maximum(node * step, step)
        if found is not None and (best is None or found[1] * unit > best.tension):
            position = found[0] / profile.q0 % profile.period
            best = PatchTension(state, position, found[1] * unit)
    return best


def _at_nodes(
    field: GapField, full: NDArray[np.complex128], harmonic: NDArray[np.int64], n: int
) -> Array:
    """Tension at n equally spaced nodes, NaN outside contact."""
    step = 2 * np.pi / n
    opening = np.zeros(n)
    free = []
    for k, (left, right) in enumerate(field.gaps):
        nodes = np.arange(int(np.floor(left / step)) + 1, int(np.ceil(right / step)))
        if not nodes.size:
            continue
        fine = fine_opening(field, k, _COARSE)
        x = nodes * step
        # over its square roots the opening is smooth up to both ends
        smooth = fine.opening / np.sqrt((fine.theta - left) * (right - fine.theta))
        value = np.interp(x, fine.theta, smooth) * np.sqrt((x - left) * (right - x))
        nodes %= n
        opening[nodes] = value
        free.append(nodes)
    relief = np.fft.rfft(opening)
    relief *= harmonic
    relief += full
    tension = -(np.fft.irfft(relief, n) + field.pressure)
    for nodes in free:
        tension[nodes] = np.nan
    return tension
