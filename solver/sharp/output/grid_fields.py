"""Stress, displacement and gap of sharp edges on equally spaced nodes.

The gaps' openings are summed from their Chebyshev series at each node; the stress on the contact is
S = S_full + p - (1/4π) ∫_gaps T(φ) / sin²((θ-φ)/2) dφ, by the Gauss-Chebyshev rule of the fine
nodes, whose spacing at an end of the gap is far below that of any output grid.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.method import Fields, Opening
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.field.opening_series import fine_opening, refine_opening, sum_modes

_FIELD_NODES = 6.0  # sine nodes per shortest wave
_FINER = 8  # points of an opening, between which it is taken as linear, for each of these nodes


def fields_of(problem: Problem, field: GapField | None, separation: float, n: int) -> Fields:
    """Fields on n nodes x_j = j λ/n; ``field`` None means no contact.

    Raises
    ------
    ValueError
        If n cannot carry the profile's shortest wave.
    """
    profile = problem.profile
    height = profile.heights(n)
    x = np.linspace(0.0, profile.period, n, endpoint=False)
    if field is None:
        return Fields(x, height, np.zeros(n), np.zeros(n), separation - height)
    theta = np.linspace(0.0, 2 * np.pi, n, endpoint=False)
    first = field.gaps[0, 0]
    place = first + (theta - first) % (2 * np.pi)
    gap = np.zeros(n)
    contact = np.ones(n, dtype=bool)
    pull = np.zeros(n)
    for left, right in field.gaps:
        contact &= ~((place > left) & (place < right))
    for k, (left, right) in enumerate(field.gaps):
        inside = (place > left) & (place < right)
        fine = fine_opening(field, k, _FIELD_NODES)
        gap[inside] = sum_modes(field.solution.nodes.table[k], place[inside], fine.modes)
        pull[contact] += _pull(theta[contact], fine.theta, fine.opening * fine.weight)
    stress = np.zeros(n)
    full = field.source.sample(theta[contact])[:, 0]
    stress[contact] = full + field.pressure - pull[contact] / (4 * np.pi)
    gap /= profile.q0
    return Fields(
        x=x,
        height=height,
        stress=stress * problem.half_space.modulus / 2,
        displacement=height + gap - separation,
        gap=gap,
    )


def openings_of(field: GapField, q0: float) -> list[Opening]:
    """Opening of every gap at points that are dense beside its edges, in m."""
    out = []
    for k, (left, right) in enumerate(field.gaps):
        modes = fine_opening(field, k, _FIELD_NODES).modes
        theta, sine_sum = refine_opening(field.solution.nodes.table[k], modes, _FINER)
        theta = np.concatenate([[left], theta, [right]])
        out.append(Opening(theta / q0, np.concatenate([[0.0], sine_sum, [0.0]]) / q0))
    return out


@compiled
def _pull(theta: Array, phi: Array, strength: Array) -> Array:
    """Σ_j strength_j / sin²((θ-φ_j)/2)."""
    out = np.zeros(theta.shape[0])
    sine, cosine = np.sin(0.5 * phi), np.cos(0.5 * phi)
    for i in range(theta.shape[0]):
        s, c = np.sin(0.5 * theta[i]), np.cos(0.5 * theta[i])
        total = 0.0
        for j in range(phi.shape[0]):
            half = s * cosine[j] - c * sine[j]
            total += strength[j] / (half * half)
        out[i] = total
    return out
