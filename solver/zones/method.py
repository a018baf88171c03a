"""Method ``zones``: adhesion of a finite range by Dugdale's law.

Algorithm and accuracy are described in docs/methods.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from adhesis.solver.checks import NODES, at_most
from adhesis.solver.method import ContactState, Fields, Method, MethodReport, Opening, Path
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.observables import openings_between
from adhesis.solver.runtime.threads import one_at_a_time
from adhesis.solver.zones.descent import Descent, Minimum
from adhesis.solver.zones.path import Steps
from adhesis.solver.zones.resolution import node_count, zone_length
from adhesis.solver.zones.surface import Surface

_LONGEST_RANGE = 10.0  # in h_max


@dataclass(frozen=True)
class ZonesReport(MethodReport):
    """Nodes, also per shortest wave and per zone, and counters."""

    nodes: int
    nodes_per_wave: float
    nodes_per_zone: float
    accuracy: float
    steps: int
    transforms: int


class ZonesMethod(Method):
    """Minima of the energy of a gap with Dugdale's law, on equally spaced nodes.

    Parameters
    ----------
    problem : Problem
        With a finite strength, or range of adhesion.
    accuracy : float
        Relative error of the loss by the places of jumps; that by the nodes is 0.003 with a zone of
        four, and falls with the square of their number.
    nodes_per_wave : int, optional
        Least number of nodes per shortest wave; by default a zone has 4, the half-width
        of a crest within the range 6, and a shortest wave 40.
    chosen : str, optional
        See ``method.Method``.
    """

    name: ClassVar[str] = "zones"
    has_zones: ClassVar[bool] = True
    resolved_adhesion: ClassVar[tuple[float, float]] = (1e-8, 1e12)  # as ``grid``
    nodes: int

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
        most = _LONGEST_RANGE * problem.profile.h_max
        if problem.attraction_range > most:
            raise ValueError(
                f"adhesion_range is {problem.attraction_range:g} m, strength {problem.strength:g} "
                f"Pa: the range must be at most {at_most(most, 3)} m, ten times h_max: far beyond "
                "that roughness does not matter"
            )
        self.nodes = node_count(problem, nodes_per_wave)
        if self.nodes > NODES.high:
            raise ValueError(
                f"the range of adhesion is {problem.attraction_range:.3g} m: {self.nodes:,} nodes "
                f"would be needed to resolve its zones, and there may be {int(NODES.high):,}; take "
                "the method 'sharp', for ranges that are so short"
            )
        self.surface = Surface(problem, self.nodes)
        self.descent = Descent(self.surface, problem.control, problem.profile.h_max)

    @one_at_a_time
    def follow(self, state: ContactState, prescribed: float) -> Path:
        """Follow the quasi-static path from ``state`` to x = ``prescribed``; see ``method.Method``.

        A state without contact stays so down to the gap at which the highest crest is attracted.
        """
        problem, control = self.problem, self.problem.control
        branch = problem.branch_to(state, prescribed)
        steps = Steps(problem, self.descent, self.accuracy, branch)
        if state.internal is None:
            touch = control.prescribed(problem.first_touch, 0.0)
            if prescribed >= touch:
                apart = problem.detached_separation(state, prescribed)
                return Path((self.detached(apart),), (), 0.0)
            here = self._apart(problem.first_touch, touch)
            steps.states.append(self.detached(problem.first_touch))
        else:
            here = self._minimum(state)
        steps.run(here, prescribed)
        return Path(tuple(steps.states), tuple(steps.jumps), steps.error)

    @one_at_a_time
    def fields(self, state: ContactState, n: int) -> Fields:
        """Compute stress, displacement and gap of ``state``, linear between the nodes."""
        surface, period = self.surface, self.problem.profile.period
        gap = state.separation - surface.height if state.internal is None else state.internal
        lifted: Array = gap + surface.height - state.separation
        stress = state.mean_stress + surface.filter(surface.stiffness / surface.sharpness, lifted)
        nodes = surface.dx * np.arange(surface.n)
        x = np.asarray(np.arange(n) * (period / n), dtype=np.float64)
        height = self.problem.profile.heights(n)
        gap = np.interp(x, nodes, gap, period=period)
        stress = np.interp(x, nodes, stress, period=period)
        return Fields(x, height, stress, gap + height - state.separation, gap)

    def openings(self, state: ContactState) -> list[Opening]:
        """Compute the openings from the gaps at nodes; at an edge of a zone they rise slowly."""
        if not state.patches:
            return []
        fields = self.fields(state, self.nodes)
        rise = np.zeros_like(state.edges)
        return openings_between(state.edges, fields, rise, self.problem.profile.period)

    def report(self) -> ZonesReport:
        """Return resolution, tolerances and counters."""
        return ZonesReport(
            name=self.name,
            chosen=self.chosen,
            nodes=self.nodes,
            nodes_per_wave=self.nodes / self.problem.highest_harmonic,
            nodes_per_zone=zone_length(self.problem) / self.surface.dx,
            accuracy=self.accuracy,
            steps=self.descent.steps,
            transforms=self.surface.transforms,
        )

    def _apart(self, separation: float, prescribed: float) -> Minimum:
        hold = self.problem.control.potential(0.0, separation, 0.0, self.problem.profile.h_max, 1.0)
        here = self.descent.at(separation - self.surface.height, prescribed)
        return replace(here, mean_stress=0.0, elastic=0.0, adhesion=0.0, potential=hold)

    def _minimum(self, state: ContactState) -> Minimum:
        """Return the minimum of a state of this method.

        Raises
        ------
        ValueError
            If another method made the state.
        """
        gap = state.internal
        if not isinstance(gap, np.ndarray) or gap.shape != (self.nodes,):
            raise ValueError("this state was not made by this method zones")
        return self.descent.at(gap, self.problem.prescribed_in(state))
