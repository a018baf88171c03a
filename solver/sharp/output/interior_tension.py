"""Find the largest tension inside patches of several states, away from their edges."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

from adhesis.solver.crack import MOST_MAXIMA
from adhesis.solver.method import PatchTension
from adhesis.solver.model.problem import Problem
from adhesis.solver.peaks import highest_peaks
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.field.patch_tension import RefinedTension, nodal_tension

# Local maxima of each state that are kept: with zero range, and where a strength may be so small
# beside the stress that flattens the profile that many seem to be higher.
_CANDIDATES = 4


def largest_tension(
    problem: Problem, field_of: Callable[[int], GapField], count: int
) -> PatchTension | None:
    """Find the largest local maximum of tension inside the patches of some states.

    Parameters
    ----------
    problem : Problem
    field_of : callable
        Returns the field of each state by its number.
    count : int
        Number of states.
    """
    profile = problem.profile
    nodal = nodal_tension(problem)
    most = _CANDIDATES if math.isinf(problem.strength) else MOST_MAXIMA

    @lru_cache(maxsize=1)
    def refined(state: int) -> RefinedTension:
        return RefinedTension.of(field_of(state))

    candidates: list[tuple[float, int, int]] = []  # tension, state, node
    for state in range(count):
        tension = nodal.of(field_of(state))
        nodes = highest_peaks(tension, most)
        candidates += [(float(tension[node]), state, node) for node in nodes]
    candidates.sort(key=lambda entry: -entry[0])
    best: PatchTension | None = None
    unit = problem.half_space.modulus / 2
    for value, state, node in candidates:
        if best is not None and value * unit <= best.tension:
            break
        found = refined(state).maximum(node * nodal.step, nodal.step)
        if found is not None and found[1] * unit > (best.tension if best else 0.0):
            position = found[0] / profile.q0 % profile.period
            best = PatchTension(state, position, found[1] * unit)
    return best
