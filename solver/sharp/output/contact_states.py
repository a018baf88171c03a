"""Contact states of method ``sharp``: energies, stress and edges in SI units, from a gap field."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from adhesis.solver.method import ContactState
from adhesis.solver.model.jump import Branch, Jump
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.counters import Counters
from adhesis.solver.sharp.equilibrium.branch_point import Point, PreviousPoint
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.field.opening_series import work_of_gaps
from adhesis.solver.sharp.field.solution import LoadingDevice
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.nucleation.clearance import NOT_SEEN, Seen
from adhesis.solver.values import with_values


@dataclass(frozen=True, eq=False)
class Memory:
    """What a state remembers, so that a path goes on from it whatever was followed in between.

    Attributes
    ----------
    gaps : array, shape (L, 2)
        The ends of its gaps.
    clearance : float
        Of them (``Point.clearance``).
    course : tuple of float, (float, float), array, float, PreviousPoint or None, optional
        Where a path stopped at it: d, p and q0 s, dn/dd of every edge, dY/dd and the point before
        it, as in ``Point``.
    seen : Seen
        The gaps as they were when they were last looked at.
    """

    gaps: Array
    clearance: float
    course: tuple[float, tuple[float, float], Array, float, PreviousPoint | None] | None = None
    seen: Seen = NOT_SEEN


def hold_of(problem: Problem) -> LoadingDevice:
    """The control of a problem in the units of the field."""
    if problem.control.is_load:
        return LoadingDevice(0.0, 1.0)
    compliance = 0.5 * problem.half_space.modulus * problem.profile.q0 / problem.control.stiffness
    return LoadingDevice(1.0, compliance)


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

    def at(self, prescribed: float) -> float:
        """What is prescribed, in the units of the field: of a separation or u_tot q0 times it."""
        if self.problem.control.is_load:
            return prescribed / self._half
        return prescribed * self.q0

    def prescribed(self, at: float) -> float:
        """What d = ``at`` is in m, under a load in Pa."""
        return at * self._half if self.problem.control.is_load else at / self.q0

    def place(self, state: ContactState) -> float:
        """What is prescribed in a state, in the units of the field."""
        return self.at(self.problem.prescribed_in(state))

    def detached(self, separation: float) -> ContactState:
        """State without contact at q0 s = ``separation``."""
        return ContactState(separation / self.q0, np.empty((0, 2)), 0.0, 0.0, 0.0, 0.0)

    def overlaps_when_detached(self, at: float) -> bool:
        """Whether no state without contact exists at d = ``at``: it would lie below s = h_max."""
        profile, control = self.problem.profile, self.problem.control
        return not control.is_load and at < profile.h_max * self.q0 * (1 - 1e-12)

    @property
    def _per_prescribed(self) -> float:
        """dY/dx in SI units where dY/dd is 1."""
        per = self._half * self.q0
        return 1 / per if self.problem.control.is_load else per

    def after_loss(self, before: ContactState, at: float) -> ContactState:
        """State without contact that ``before`` leaves behind at d = ``at``.

        Under a load nothing holds it: the loop is closed at the separation of the loss.
        """
        if self.problem.control.is_load:
            return self.detached(before.separation * self.q0)
        return self.detached(at)

    def _hold_energy(self, separation: float, mean_stress: float) -> float:
        profile, control = self.problem.profile, self.problem.control
        return control.potential(0.0, separation, mean_stress, profile.h_max, profile.period)

    def of_point(self, point: Point, separation: float | None = None) -> ContactState:
        """State of a point of a branch; ``separation`` (m) where it is known without rounding."""
        return self.of_field(point.field, point.slope, separation, point.clearance)

    def of_field(
        self,
        gap_field: GapField,
        slope: float = float("nan"),
        separation: float | None = None,
        clearance: float = 0.0,
    ) -> ContactState:
        """State of a field with dY/dd = ``slope``; ``separation`` (m) as in :meth:`of_point`."""
        self.count.energies += 1
        half = self._half
        at = gap_field.separation
        if separation is None:
            separation = at / self.q0
        mean_stress = gap_field.pressure * half
        gaps = gap_field.gaps
        patches, measure = self.source.contact_between(gaps)
        elastic = (
            self._full_energy + 0.5 * work_of_gaps(gap_field) - np.pi * at * gap_field.pressure
        )
        return ContactState(
            separation=separation,
            edges=patches / self.q0,
            mean_stress=mean_stress,
            elastic_energy=elastic * half / self.q0**2,
            adhesion_energy=-self.problem.work_of_adhesion * measure / self.q0,
            contact_fraction=float((patches[:, 1] - patches[:, 0]).sum() / (2 * np.pi)),
            stiffness=slope * self._per_prescribed,
            hold_energy=self._hold_energy(separation, mean_stress),
            internal=Memory(gaps, clearance),
        )

    def shifted(self, state: ContactState, gap_field: GapField, at: float) -> ContactState:
        """State at d = ``at`` with the edges of ``state``: p is linear in s, U quadratic."""
        way = at - gap_field.prescribed
        pressure = gap_field.pressure + gap_field.pressure_by_prescribed * way
        apart = at
        if not self.problem.control.is_fixed:
            apart = gap_field.separation + gap_field.separation_by_prescribed * way
        work = -np.pi * (apart - gap_field.separation) * (gap_field.pressure + pressure)
        separation, mean_stress = apart / self.q0, pressure * self._half
        return with_values(
            state,
            separation=separation,
            mean_stress=mean_stress,
            elastic_energy=state.elastic_energy + work * self._half / self.q0**2,
            stiffness=float("nan"),
            hold_energy=self._hold_energy(separation, mean_stress),
            internal=Memory(gap_field.gaps, 0.0),
        )

    def work(self, before: ContactState, after: ContactState, way: float) -> float:
        """|Y_before - Y_after| times ``way`` (in d), in J/m² of nominal area."""
        control, h_max = self.problem.control, self.problem.profile.h_max
        conjugate = [control.conjugate(s.separation, s.mean_stress, h_max) for s in (before, after)]
        unit = self._half if control.is_load else 1 / self.q0
        return abs(conjugate[0] - conjugate[1]) * way * unit

    def imbalance(self, before: ContactState, after: ContactState) -> float:
        """Compute the change of energy between two states of a branch, less the work, in J/m²."""
        control, h_max = self.problem.control, self.problem.profile.h_max
        both = before, after
        x = [control.prescribed(state.separation, state.mean_stress) for state in both]
        y = [control.conjugate(state.separation, state.mean_stress, h_max) for state in both]
        way, change = x[1] - x[0], after.stiffness - before.stiffness
        work = 0.5 * way * (y[0] + y[1]) - way**2 * change / 12
        return (after.potential - before.potential) / self.period + work

    def apart(self, one: ContactState, other: ContactState) -> float:
        """Difference of two energies, in J/m² of nominal area."""
        return abs(other.potential - one.potential) / self.period

    def jump(
        self,
        before: ContactState,
        after: ContactState,
        branch: Branch,
        at_stake: float | None = None,
        barrier: float = 0.0,
    ) -> Jump:
        """Jump between two states, with what is ``at_stake`` in J/m² if it raced.

        ``barrier`` is that of an opening, in units of γ/q0.
        """
        barrier *= self.problem.work_of_adhesion / (self.q0 * self.period)
        jump = Jump.between(
            before, after, branch, self.period, raced=at_stake is not None,
            at_stake=at_stake or 0.0, barrier=barrier,
        )  # fmt: skip
        if self.problem.control.is_load and not after.patches:
            # The load's own work is not counted, which may leave less than nothing.
            jump = replace(jump, energy_drop=before.energy / self.period)
        return jump
