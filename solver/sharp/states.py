"""Contact states of method ``sharp``: energies, stress and edges in SI units, from a gap field."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from solver.jumps import Branch, Jump
from solver.method import ContactState
from solver.problem import Problem
from solver.sharp.edges import Counters, Point
from solver.sharp.field import GapField
from solver.sharp.opening import work_of_gaps
from solver.sharp.source import StressSource


@dataclass
class Trace:
    """States and jumps of a path, in order, as they are found."""

    states: list[ContactState] = field(default_factory=list)
    jumps: list[Jump] = field(default_factory=list)


class States:
    """Makes contact states of one problem.

    Parameters
    ----------
    problem : Problem
    source : StressSource
    count : Counters
    """

    def __init__(self, problem: Problem, source: StressSource, count: Counters) -> None:
        self.problem, self.source, self.count = problem, source, count
        profile = problem.profile
        self.q0 = profile.q0
        self.period = profile.period
        self._half = problem.half_space.modulus / 2
        m = np.arange(profile.coefficients.size)
        h = np.abs(profile.coefficients * self.q0) ** 2
        self._full_energy = float(2 * np.pi * np.sum(m * h))  # ½∫S_full h~, both signs of m

    def detached(self, at: float) -> ContactState:
        """State without contact at q0 s = ``at``."""
        return ContactState(at / self.q0, np.empty((0, 2)), 0.0, 0.0, 0.0, 0.0)

    def of_point(self, point: Point, separation: float | None = None) -> ContactState:
        """State of a point of a branch; ``separation`` (m) where it is known without rounding."""
        return self.of_field(point.field, point.at, point.slope, separation)

    def of_field(
        self,
        gap_field: GapField,
        at: float,
        slope: float = float("nan"),
        separation: float | None = None,
    ) -> ContactState:
        """State of a field at q0 s = ``at``, dp/d(q0 s) = ``slope``."""
        self.count.energies += 1
        half = self._half
        gaps = gap_field.gaps
        left = np.append(gaps[-1, 1] - 2 * np.pi, gaps[:-1, 1])  # of the patch before each gap
        right = gaps[:, 0]
        measure = self.source.measure_between(left, right)
        turn = np.floor(left / (2 * np.pi)) * 2 * np.pi
        patches = np.stack([left - turn, right - turn], axis=1) / self.q0
        elastic = (
            self._full_energy + 0.5 * work_of_gaps(gap_field) - np.pi * at * gap_field.pressure
        )
        return ContactState(
            separation=at / self.q0 if separation is None else separation,
            edges=patches[np.argsort(patches[:, 0])],
            mean_stress=gap_field.pressure * half,
            elastic_energy=elastic * half / self.q0**2,
            adhesion_energy=-self.problem.work_of_adhesion * measure / self.q0,
            contact_fraction=float((right - left).sum() / (2 * np.pi)),
            stiffness=slope * half * self.q0,
            internal=gaps,
        )

    def shifted(self, state: ContactState, gap_field: GapField, at: float) -> ContactState:
        """State at q0 s = ``at`` with the edges of ``state``: p is linear in s, U quadratic."""
        way = at - gap_field.separation
        pressure = gap_field.pressure + gap_field.pressure_by_prescribed * way
        work = -np.pi * way * (gap_field.pressure + pressure)
        return replace(
            state,
            separation=at / self.q0,
            mean_stress=pressure * self._half,
            elastic_energy=state.elastic_energy + work * self._half / self.q0**2,
            stiffness=float("nan"),
        )

    def jump(self, before: ContactState, after: ContactState, branch: Branch) -> Jump:
        """Jump between two states."""
        return Jump.between(before, after, branch, self.period)
