"""Compute contact states of method ``sharp`` from a gap field: energies, stress, edges in SI."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from adhesis.solver._kernels import LoadingDevice, SearchedGaps
from adhesis.solver.method import ContactState
from adhesis.solver.model.jump import Branch
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.gap.ends import union_of
from adhesis.solver.sharp.gap.full_contact_stress import patches_between
from adhesis.solver.sharp.mechanics import EdgeMechanics, PinnedEdges, Point, PreviousPoint
from adhesis.solver.values import with_values


class BranchData(NamedTuple):
    """Point of a branch at which a path stopped: d, p and q0 s, and the rest of ``Point``.

    With the gaps as they were when they were last searched for touches, and the way it came on.
    """

    prescribed: float
    nearly: tuple[float, float]
    rate: Array
    slope: float
    previous: PreviousPoint | None
    pinned: PinnedEdges | None
    searched: SearchedGaps
    direction: Branch


class ContinuationData(NamedTuple):
    """Gaps of a state, shape (L, 2), and the point at which a path stopped there, if one did."""

    gaps: Array
    stopped: BranchData | None = None


def loading_device(problem: Problem) -> LoadingDevice:
    """Return the control of a problem in the units of the field."""
    if problem.control.is_load:
        return LoadingDevice(0.0, 1.0)
    compliance = 0.5 * problem.half_space.modulus * problem.profile.q0 / problem.control.stiffness
    return LoadingDevice(1.0, compliance)


class States:
    """Contact states and conversions of units of one problem."""

    def __init__(self, problem: Problem, edges: EdgeMechanics) -> None:
        self.problem, self.adhesion, self.count = problem, edges.adhesion, edges.count
        profile = problem.profile
        self.q0 = profile.q0
        self.period = profile.period
        self._half = problem.half_space.modulus / 2
        per = self._half * self.q0
        self._tangent_unit = 1 / per if problem.control.is_load else per  # dY/dx at dY/dd = 1
        full = problem.full_contact_energy * profile.period
        self._full_energy = full * self.q0**2 / self._half  # ½∫S_full h~

    def to_field_units(self, prescribed: float) -> float:
        """Convert the prescribed value to d: q0 (s - p̄/k) at a stiffness k, -2p̄/E* of a load."""
        if self.problem.control.is_load:
            return prescribed / self._half
        return prescribed * self.q0

    def to_si(self, d: float) -> float:
        """Convert ``d`` to the prescribed value in m, under a load in Pa."""
        return d * self._half if self.problem.control.is_load else d / self.q0

    def prescribed_of(self, state: ContactState) -> float:
        """Return the prescribed value of a state in field units, d."""
        return self.to_field_units(self.problem.prescribed_in(state))

    def attracts_when_detached(self, d: float, touch: float | None = None) -> bool:
        """Return whether a state without contact at ``d`` would lie below q0 s = ``touch``.

        That is by default q0 h_max, below which surfaces would overlap.
        """
        touch = self.problem.profile.h_max * self.q0 if touch is None else touch
        return not self.problem.control.is_load and d < touch * (1 - 1e-12)

    def of_point(
        self,
        point: Point,
        separation: float | None = None,
        held: float | None = None,
    ) -> ContactState:
        """Make the state of a point, or of its edges ``held`` at another d.

        ``separation`` (m) is given if it is known without rounding.
        """
        self.count.energies += 1
        half, gaps, solution = self._half, point.gaps, point.field.solution
        q0_s, pressure, slope = solution.separation, solution.pressure, point.slope
        elastic = self._full_energy + 0.5 * point.field.work - np.pi * q0_s * pressure
        if held is not None:  # p is linear in d, and the energy quadratic
            (p_rate, s_rate, _), way = solution.by_prescribed(), held - point.d
            elastic -= np.pi * s_rate * way * (2 * pressure + p_rate * way)
            pressure, slope = pressure + p_rate * way, math.nan
            q0_s = held if self.problem.control.is_fixed else q0_s + s_rate * way
        if separation is None:
            separation = q0_s / self.q0
        mean_stress = pressure * half
        patches, closed = patches_between(gaps), self.adhesion.contact_work(gaps)
        control, profile = self.problem.control, self.problem.profile
        hold = control.potential(0.0, separation, mean_stress, profile.h_max, profile.period)
        return ContactState(
            separation=separation,
            edges=patches / self.q0,
            mean_stress=mean_stress,
            elastic_energy=elastic * half / self.q0**2,
            adhesion_energy=-self.problem.work_of_adhesion * closed / self.q0,
            contact_fraction=float((patches[:, 1] - patches[:, 0]).sum() / (2 * np.pi)),
            tangent=slope * self._tangent_unit,
            hold_energy=hold,
            internal=ContinuationData(gaps),
        )

    def with_friction(self, before: ContactState, states: list[ContactState]) -> list[ContactState]:
        """Return states with the energy that receding edges have dissipated since one before.

        Where the solid falls off under a load neither the work of that counts nor what they
        dissipate then (``model.control``).
        """
        out, total = [], before.edge_friction
        for state in states:
            falls_off = self.problem.control.is_load and not state.patches
            if before.patches and not falls_off:
                lost = self._friction_of(before.internal.gaps)
                if state.patches:
                    lost -= self._friction_of(union_of(before.internal.gaps, state.internal.gaps))
                total += max(lost, 0.0)
            out.append(with_values(state, edge_friction=total))
            before = state
        return out

    def _friction_of(self, gaps: Array) -> float:
        """Energy in J/m that edges dissipate as they recede from the contact between gaps."""
        if not len(gaps):
            return 0.0  # they leave none
        both = self.adhesion.contact_work(gaps, True), self.adhesion.contact_work(gaps)
        return self.problem.work_of_adhesion * (both[0] - both[1]) / self.q0

    def work(self, before: ContactState, after: ContactState, way: float) -> float:
        """Compute |Y_before - Y_after| times ``way`` (in d), in J/m² of nominal area."""
        unit = self._half if self.problem.control.is_load else 1 / self.q0
        return abs(self._conjugate(before) - self._conjugate(after)) * way * unit

    def _conjugate(self, state: ContactState) -> float:
        h_max = self.problem.profile.h_max
        return self.problem.control.conjugate(state.separation, state.mean_stress, h_max)
