"""Compute stress, displacement and gap of sharp edges on equally spaced nodes.

The openings at the nodes are summed from Chebyshev series; the stress on the contact is
that of ``patch_tension``.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver._kernels import SHAPE_NODES
from adhesis.solver.method import Fields, Opening
from adhesis.solver.model.problem import Problem
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.field.patch_tension import RefinedTension

_FINER = 8  # points of an opening, between which it is taken as linear, for each fine node


def fields_of(problem: Problem, field: GapField | None, separation: float, n: int) -> Fields:
    """Compute the fields on n nodes x_j = j λ/n; ``field`` is None without contact.

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
    position = first + (theta - first) % (2 * np.pi)
    gap = np.zeros(n)
    contact = np.ones(n, dtype=bool)
    openings = []
    for k, (left, right) in enumerate(field.gaps):
        inside = (position > left) & (position < right)
        openings.append(field.fine_opening(k))
        gap[inside] = field.solution.sum_modes(k, position[inside], openings[k].modes)
        contact[inside] = False
    stress = np.zeros(n)
    stress[contact] = -RefinedTension(field, openings).at(theta[contact])
    gap /= profile.q0
    return Fields(
        x=x,
        height=height,
        stress=stress * problem.half_space.modulus / 2,
        displacement=height + gap - separation,
        gap=gap,
    )


def openings_of(field: GapField, q0: float) -> list[Opening]:
    """Evaluate the opening of every gap in m, at points that are dense beside its edges."""
    out = []
    for k, (left, right) in enumerate(field.gaps):
        fine = field.fine_opening(k, _FINER * SHAPE_NODES)
        theta = np.concatenate([[left], fine.theta, [right]])
        out.append(Opening(theta / q0, np.concatenate([[0.0], fine.opening, [0.0]]) / q0))
    return out
