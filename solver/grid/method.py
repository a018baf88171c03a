"""Method ``grid``: contact sets of grid nodes, moved by energy comparison.

It takes any profile and contact geometry and is the reference for faster methods; algorithm and
accuracy are described in docs/methods.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from adhesis.solver.grid.contact import Contact
from adhesis.solver.grid.path import Steps
from adhesis.solver.grid.relax import Relaxation
from adhesis.solver.grid.states import mask_of
from adhesis.solver.method import ContactState, Fields, Method, MethodReport, Opening, Path
from adhesis.solver.model.problem import Problem
from adhesis.solver.observables import openings_between
from adhesis.solver.runtime.threads import one_at_a_time

_FEWEST_NODES_PER_WAVE = 8
# The error of the loss is of first order in dx. With 32 nodes per shortest wave it is 1e-3 on the
# rough profiles of the benchmark; more than 256 nodes must be requested explicitly.
_FIRST_ORDER = 0.032
_MOST_NODES_PER_WAVE = 256
# A single wave with 32 nodes does not resolve its edges.
_FEWEST_NODES = 1024


@dataclass(frozen=True)
class GridReport(MethodReport):
    """Nodes, also per shortest wave, largest displacement of an edge in one sweep, and counters."""

    nodes: int
    nodes_per_wave: float
    accuracy: float
    longest_step: int
    sweeps: int
    solves: int


class GridMethod(Method):
    """Contact states on an equally spaced grid.

    Parameters
    ----------
    problem : Problem
    accuracy : float
        Wanted relative error of the loss: sets the tolerances of the location of jumps and of the
        load steps, and the nodes unless they are given.
    nodes_per_wave : int, optional
        Least number of nodes per shortest wave. Default: 0.032/accuracy (32 at 1e-3), from 8 to
        256; at 256 the discretisation error is about 1e-4, also for a smaller accuracy. The number
        of nodes is rounded up to a power of two, by default at least 1024.
    chosen : str, optional
        See ``method.Method``.
    """

    name: ClassVar[str] = "grid"
    nodes: int
    # For smaller γ the loss is below the errors of the two works of which it is the difference;
    # above 1e12 contact lasts to 1e6 h_max, where the gap no longer depends on the profile.
    resolved_adhesion: ClassVar[tuple[float, float]] = (1e-8, 1e12)

    def __init__(
        self,
        problem: Problem,
        *,
        accuracy: float = 1e-3,
        nodes_per_wave: int | None = None,
        chosen: str | None = None,
    ) -> None:
        super().__init__(problem, chosen=chosen)
        self.accuracy = accuracy
        self.nodes = _node_count(problem.highest_harmonic, accuracy, nodes_per_wave)
        self.relaxation = Relaxation(problem, self.nodes)
        self.lattice, self.solver = self.relaxation.lattice, self.relaxation.solver

    # ------------------------------------------------------------------ contract

    @one_at_a_time
    def follow(self, state: ContactState, prescribed: float) -> Path:
        """Follow the quasi-static path from ``state`` to x = ``prescribed``; see ``method.Method``.

        A state without contact stays without contact down to s = h_max, where the surfaces touch.
        """
        control = self.problem.control
        branch = self.problem.branch_to(state, prescribed)
        steps = Steps(self.problem, self.relaxation, self.accuracy, branch)
        h_max = self.problem.profile.h_max
        if state.patches == 0:
            if prescribed > control.prescribed(h_max, 0.0):
                apart = self.problem.detached_separation(state, prescribed)
                return Path((self.detached(apart),), (), 0.0)
            contact = steps.first_touch(h_max)
        else:
            contact = self._contact(state)
        steps.run(contact, prescribed)
        return Path(tuple(steps.states), tuple(steps.jumps), steps.error)

    @one_at_a_time
    def fields(self, state: ContactState, n: int) -> Fields:
        """Compute stress, displacement and gap of ``state`` on every (nodes/n)-th node.

        Raises
        ------
        ValueError
            If n does not divide the number of nodes.
        """
        if n < 1 or self.nodes % n:
            raise ValueError(f"fields on {n} nodes: the grid has {self.nodes}, n must divide that")
        contact = self._contact(state)
        pick = slice(None, None, self.nodes // n)
        gap = self.lattice.gap(contact)
        gap[contact.mask] = 0.0
        return Fields(
            x=np.asarray(np.arange(n) * (self.problem.profile.period / n), dtype=np.float64),
            height=self.lattice.height[pick].copy(),
            stress=contact.stress[pick].copy(),
            displacement=contact.displacement[pick].copy(),
            gap=gap[pick],
        )

    @one_at_a_time
    def openings(self, state: ContactState) -> list[Opening]:
        """Compute the openings from the gaps at nodes, and Griffith's criterion at the edges."""
        if not state.patches:
            return []
        profile = self.problem.profile
        toughness = self.problem.toughness(state.edges, profile.at(state.edges, derivative=1))
        coefficient = 4 * np.sqrt(toughness / (np.pi * self.problem.half_space.modulus))
        fields = self.fields(state, self.nodes)
        return openings_between(state.edges, fields, coefficient, profile.period)

    def report(self) -> GridReport:
        """Return resolution, tolerances and counters."""
        return GridReport(
            name=self.name,
            chosen=self.chosen,
            nodes=self.nodes,
            nodes_per_wave=self.nodes / self.problem.highest_harmonic,
            accuracy=self.accuracy,
            longest_step=self.relaxation.longest_step,
            sweeps=self.relaxation.sweeps,
            solves=self.solver.solves,
        )

    # ------------------------------------------------------------------ states

    def _contact(self, state: ContactState) -> Contact:
        """Solve the contact of a state of this method from its contact set alone."""
        contact = self.solver.empty(state.separation)
        contact.prescribed = self.problem.prescribed_in(state)
        if state.patches:
            contact.mask = mask_of(self.lattice, state)
            self.solver.solve(contact, self.relaxation.tight)
        return contact


def _node_count(harmonic: int, accuracy: float, nodes_per_wave: int | None) -> int:
    if nodes_per_wave is None:
        per_wave = min(max(_FIRST_ORDER / accuracy, _FEWEST_NODES_PER_WAVE), _MOST_NODES_PER_WAVE)
        wanted = max(round(per_wave) * harmonic, _FEWEST_NODES)
    else:
        wanted = nodes_per_wave * harmonic
    return 1 << (wanted - 1).bit_length()
