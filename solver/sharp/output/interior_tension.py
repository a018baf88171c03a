"""Find the largest tension inside patches of several states, away from their edges."""

from __future__ import annotations

from collections.abc import Callable

from adhesis.solver.method import PatchTension
from adhesis.solver.model.problem import Problem
from adhesis.solver.peaks import highest_peaks
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.field.patch_tension import RefinedTension, nodal_tension
from adhesis.solver.sharp.tolerances import MOST_MAXIMA


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
    best: PatchTension | None = None
    largest, unit = 0.0, problem.half_space.modulus / 2
    for state in range(count):
        field = field_of(state)
        nodes = highest_peaks(nodal.of(field), MOST_MAXIMA, largest)
        if nodes:
            refined = RefinedTension.of(field)
        for node in nodes:
            found = refined.maximum(node * nodal.step, nodal.step)
            if found is not None and found[1] > largest:
                largest = found[1]
                position = found[0] / profile.q0 % profile.period
                best = PatchTension(state, position, largest * unit)
    return best
