"""A state of a loop at a mean stress, located with the loop's method, and its fields."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.checks import at_least, at_most
from adhesis.solver.loading.equilibrium_path import EquilibriumPath
from adhesis.solver.loading.mean_stress_event import REACHED, locate
from adhesis.solver.method import ContactState, Fields, Method, Opening
from adhesis.solver.model.jump import Branch
from adhesis.solver.model.profile import Array
from adhesis.solver.values import ByValue

# Nodes of fields for each of the shortest waves, where a method has no grid of its own.
_NODES_PER_WAVE = 32


@dataclass(frozen=True, eq=False, repr=False)
class LoopState(ByValue):
    """A state in contact of a loop, with the method that computes its fields (docs/preload.md).

    Attributes
    ----------
    branch : {"loading", "unloading"}
    after_jump : bool
        True if only jumps pass the wanted mean stress: the state is the end of the first of them.
    penetration : float
        Δ/h_max.
    state : ContactState
    method : Method
    """

    branch: Branch
    after_jump: bool
    penetration: float
    state: ContactState
    method: Method

    @property
    def separation(self) -> float:
        """Separation s in m."""
        return self.state.separation

    @property
    def mean_stress(self) -> float:
        """p̄ in Pa, compression positive."""
        return self.state.mean_stress

    @property
    def contact_fraction(self) -> float:
        """A/A0."""
        return self.state.contact_fraction

    @property
    def edges(self) -> Array:
        """Left and right edge of each patch in m, shape (patches, 2)."""
        return self.state.edges

    def fields(self, nodes: int | None = None) -> Fields:
        """Compute stress, displacement and gap on equally spaced nodes.

        Parameters
        ----------
        nodes : int, optional
            By default those of the method's grid, or at least 32 for each of the shortest waves.

        Raises
        ------
        ValueError
            If the method cannot compute them for so many nodes.
        """
        return self.method.fields(self.state, field_nodes(self.method) if nodes is None else nodes)

    def openings(self) -> list[Opening]:
        """Compute the opening of every gap, from edge to edge of contact."""
        return self.method.openings(self.state)


def field_nodes(method: Method) -> int:
    """Return the number of nodes of fields, unless it is given."""
    if method.nodes is not None:
        return method.nodes
    waves = method.problem.profile.highest_harmonic
    return int(1 << (_NODES_PER_WAVE * waves - 1).bit_length())


def state_at_stress(
    path: EquilibriumPath, method: Method, branch: Branch, chosen: NDArray[np.intp], stress: float
) -> LoopState:
    """Find the first state in contact of a branch that has a mean stress.

    Where only jumps pass the mean stress, it is the end of the first of them. ``chosen`` are the
    indices of the states of the branch; the stress is in Pa.

    Raises
    ------
    ValueError
        If no state of the branch has it.
    """
    states = path.contact_states
    found = {i: states[i].mean_stress - stress for i in chosen.tolist() if states[i].patches}
    near = REACHED * abs(stress)
    found = {i: 0.0 if abs(difference) <= near else difference for i, difference in found.items()}
    least, most = min(found.values()), max(found.values())
    if least > 0 or most < 0:
        low, high = stress + least, stress + most
        low, high = low - REACHED * abs(low), high + REACHED * abs(high)
        raise ValueError(
            f"stress is {stress:g} Pa: on the {branch} branch the mean stress in contact lies "
            f"between {at_least(low, 6)} and {at_most(high, 6)} Pa"
        )
    at = [i for i, difference in found.items() if difference == 0]
    passing = [i for i in found if i - 1 in found and found[i - 1] * found[i] < 0]
    jumps = set(path.states_before_jumps())
    smooth = [i for i in passing if i - 1 not in jumps]
    after_jump = not (at or smooth)
    first = min(passing if after_jump else at + smooth)
    state = states[first]
    if first in smooth:
        sign = float(np.sign(found[first])) / max(-least, most)
        start = states[first - 1]
        way = locate(method, start, state, lambda passed: sign * (passed.mean_stress - stress))
        state = way.states[-1]
    penetration = float(method.problem.penetration(state.separation))
    return LoopState(branch, after_jump, penetration, state, method)
