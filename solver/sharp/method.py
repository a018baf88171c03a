"""Method ``sharp``: contact edges are real numbers; no grid in the mechanics.

The elastic field is solved on a tree of the gaps (``mechanics``). Stable branches are followed by
predictor and corrector (``continuation``); where no stable equilibrium is found within the largest
correction, the step is reduced to the resolution of a jump, and the edges descend in energy at a
fixed prescribed value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import numpy as np

from adhesis.solver._kernels import Adhesion
from adhesis.solver.checks import at_least, at_most
from adhesis.solver.method import (
    ContactState,
    Fields,
    Method,
    MethodReport,
    Opening,
    PatchTension,
    Path,
    PathError,
)
from adhesis.solver.model.problem import Problem
from adhesis.solver.runtime.threads import one_at_a_time
from adhesis.solver.sharp.adhesion import adhesion_of, check_adhesion, symmetry_of
from adhesis.solver.sharp.continuation.branch import Resolution, Target
from adhesis.solver.sharp.continuation.descent import FullContact, NoState
from adhesis.solver.sharp.continuation.follower import Follower
from adhesis.solver.sharp.continuation.jump import Event, History
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.field.patch_tension import InnerTension
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.mechanics import EdgeMechanics, Point
from adhesis.solver.sharp.output.contact_states import States, loading_device
from adhesis.solver.sharp.output.grid_fields import fields_of, openings_of
from adhesis.solver.sharp.tolerances import (
    FIELD_ACCURACY,
    FIELD_RESOLVES,
    FIELD_SHARE,
    JUMP_RESOLUTION,
    LARGEST_FIELD_TOLERANCE,
    LATE_DROP,
    LEAST_DROP,
    LONGEST_GRIFFITH_CRACK,
    OTHER_MINIMUM,
    OVERLAP,
    PLACED_BY_PROFILE,
    RANGE_RESOLVED,
    ROUNDING,
    TRAPEZOID,
    WEAKNESS_POWER,
)


def check_range(problem: Problem) -> None:
    """Refuse a range of adhesion at which cohesive zones at edges are as long as the waves.

    The crack that is in equilibrium under a uniform tension of the strength measures them.
    """
    modulus, gamma = problem.half_space.modulus, problem.work_of_adhesion
    most = LONGEST_GRIFFITH_CRACK * problem.profile.shortest_wavelength
    crack = 4 * modulus * gamma / (math.pi * problem.strength**2)
    if crack <= most:
        return
    least = math.sqrt(4 * modulus * gamma / (math.pi * most))
    raise ValueError(
        f"adhesion_range is {problem.attraction_range:g} m, strength {problem.strength:g} Pa: with "
        f"the method 'sharp' they must be at most {at_most(gamma / least, 3)} m and at least "
        f"{at_least(least, 3)} Pa for this profile, or Griffith's crack at the strength, "
        f"{crack:.3g} m long, exceeds a quarter of the shortest wave, and edges of zero range do "
        "not describe it; the method 'zones' takes longer ones"
    )


@dataclass(frozen=True)
class SharpReport(MethodReport):
    """Relative accuracy of loss and field, resolution of jumps, and ``mechanics.Counters``.

    A jump is located to that part of h_max, under a load to that σ~.
    """

    accuracy: float
    field_tolerance: float
    jump_resolution: float
    fields: int
    energies: int
    openings: int
    newton_steps: int
    descent_steps: int


class SharpMethod(Method):
    """Contact states with real-valued edges.

    Parameters
    ----------
    problem : Problem
    accuracy : float
        Wanted relative error of the loss: sets the accuracy of the field, the resolution of the
        separation of jumps and the density of the states.
    chosen : str, optional
        See ``method.Method``.
    adhesion : Adhesion, optional
        Law of the edges, in units of the problem's γ (``kernels/edge_law.hpp``); by default that
        of the problem.

    Raises
    ------
    ValueError
        If such a law breaks its contract, or the range of adhesion is so long that Griffith's crack
        at the strength is longer than a quarter of the shortest wave.
    """

    name = "sharp"
    # Measured on a wave and self-affine profiles at accuracy 1e-3. Below, the loss, 0.6 g^(4/3) of
    # the energy of full contact at g of it, is no larger than the rounding of the two works whose
    # difference it is, some 1e-11; above, Newton's iteration does not converge, as the profile is
    # too small in the openings to fix the position of the last gap.
    resolved_adhesion: ClassVar[tuple[float, float]] = (1e-8, 1e10)

    def __init__(
        self,
        problem: Problem,
        *,
        accuracy: float = 1e-3,
        chosen: str | None = None,
        adhesion: Adhesion | None = None,
    ) -> None:
        super().__init__(problem, chosen=chosen)
        check_range(problem)
        profile, modulus = problem.profile, problem.half_space.modulus
        self.accuracy = accuracy
        self.q0 = profile.q0
        h_max = profile.h_max * self.q0
        critical = float(4 * np.sqrt(self.q0 * problem.work_of_adhesion / (np.pi * modulus)))
        # over the opening that roughness makes, h' sqrt(λ_min)
        ratio = float(critical / np.sqrt(profile.m2 * 2 * np.pi / profile.highest_harmonic))
        # If adhesion is weak, C_c is a small difference of the openings caused by roughness, and
        # the loss, of the order of its square, a small difference of two works: the field, and the
        # integral along a branch (of fourth order), have to be as much finer.
        weak = min(1.0, ratio) if ratio > 0 else 1.0
        # Under a load s goes like a square root before a fold, and the loss of contact depends on
        # it.
        load = problem.control.is_load
        finer = FIELD_ACCURACY if load else 1.0
        tolerance = FIELD_ACCURACY * accuracy * weak**2 * finer
        tolerance = float(np.clip(tolerance, ROUNDING, LARGEST_FIELD_TOLERANCE))
        # The profile alone fixes the position of a last gap, by openings so much smaller than C_c.
        if ratio > 0:
            tolerance = max(min(tolerance, PLACED_BY_PROFILE / ratio), ROUNDING)
        # Openings are compared with the range, up to the overlap that is allowed.
        if math.isfinite(problem.strength):
            touch = RANGE_RESOLVED * problem.attraction_range / profile.h_max
            tolerance = min(tolerance, max(touch, 0.5 * OVERLAP))
        source = StressSource(profile, tolerance, problem.measure, problem.pattern)
        device = loading_device(problem)
        if adhesion is not None:
            check_adhesion(adhesion, problem, source)
        symmetry = symmetry_of(problem, adhesion, OTHER_MINIMUM * 2 * np.pi / source.top)
        adhesion = adhesion or adhesion_of(problem, source)
        self.edges = EdgeMechanics(source, critical, tolerance, device, adhesion, symmetry)
        self.states = States(problem, self.edges)
        limit = max(FIELD_RESOLVES * tolerance, ROUNDING)
        self.resolution = Resolution(
            jump=max(JUMP_RESOLUTION * accuracy * (accuracy if load else 1.0), limit) * h_max,
            bend=float(TRAPEZOID * np.sqrt(min(1.0, accuracy / 1e-3)) * weak**WEAKNESS_POWER),
            h_max=h_max,
            field_limit=limit * h_max,
            late=LATE_DROP * accuracy,
            least_drop=LEAST_DROP * problem.work_of_adhesion,
            field_share=FIELD_SHARE * accuracy,
        )
        self.follower = Follower(problem, self.edges, self.states, self.resolution)
        self.nucleation, self.jumps = self.follower.nucleation, self.follower.jumps
        self._inner = InnerTension(problem)
        self._loaded: list[ContactState] = []  # without adhesion unloading goes back through them

    def report(self) -> SharpReport:
        """Return accuracy, tolerances and counters."""
        return SharpReport(
            name=self.name,
            chosen=self.chosen,
            accuracy=self.accuracy,
            field_tolerance=self.edges.tolerance,
            jump_resolution=self.resolution.jump / self.resolution.h_max,
            **asdict(self.edges.count),
        )

    @one_at_a_time
    def fields(self, state: ContactState, n: int) -> Fields:
        """Compute stress, displacement and gap of ``state`` on n nodes, by quadrature over gaps."""
        field = self._field(state) if state.patches else None
        return fields_of(self.problem, field, state.separation, n)

    @one_at_a_time
    def largest_tension(self, states: Sequence[ContactState]) -> PatchTension | None:
        """Find the largest local maximum of tension inside patches; see the contract."""
        best: PatchTension | None = None
        largest, unit = 0.0, self.problem.half_space.modulus / 2
        for number, state in enumerate(states):
            for theta, tension in self._inner.maxima(self._field(state), largest):
                if tension > largest:
                    largest = tension
                    position = theta / self.q0 % self.problem.profile.period
                    best = PatchTension(number, position, largest * unit)
        return best

    @one_at_a_time
    def openings(self, state: ContactState) -> list[Opening]:
        """Evaluate the openings of all gaps from their series."""
        return openings_of(self._field(state), self.q0) if state.patches else []

    def _field(self, state: ContactState) -> GapField:
        """Solve the field of a state in contact."""
        return self.edges.field(state.internal.gaps, self.states.prescribed_of(state))

    @one_at_a_time
    def follow(self, state: ContactState, prescribed: float) -> Path:
        """Follow the quasi-static path; see the contract."""
        direction = self.problem.branch_to(state, prescribed)
        target = Target(self.states.to_field_units(prescribed), prescribed, direction)
        try:
            if self.problem.work_of_adhesion == 0:
                return self._follow_reversibly(state, target)
            history = self._history(state, target)
        except FullContact:
            raise PathError(self.problem.full_contact(prescribed)) from None
        except (NoState, FloatingPointError) as failed:
            d = failed.d if isinstance(failed, NoState) else target.d
            where = self.problem.describe_prescribed(self.states.to_si(d))
            raise PathError(
                f"method 'sharp' finds no state at {where}: {failed}; another accuracy or other "
                f"load steps{self.problem.or_other_method} may get past it"
            ) from failed
        states = history.states
        if self.edges.adhesion.pins:
            states = self.states.with_friction(state, states)
        drops = sum(abs(jump.energy_drop) for jump in history.jumps)
        # that of the location of jumps, and that of the field
        error = history.misplaced + self.resolution.field_share * drops
        return Path(tuple(states), tuple(history.jumps), error)

    def _history(self, state: ContactState, target: Target) -> History:
        history = History()
        touch, highest = self.jumps.first_touch()  # kept: the first path must not depend on it
        self.edges.forget()
        control = self.problem.control
        d = self.states.prescribed_of(state)
        point = self.follower.recall_point(state.internal)
        if not state.patches:
            first = 0.0 if control.is_load else touch
            if target.direction == "unloading" or target.d > first:
                apart = self.problem.detached_separation(state, target.prescribed)
                history.states.append(self.detached(apart))
                return history
            d, gaps = first, np.empty((0, 2))
            start = self.nucleation.insert(gaps, highest)
            may_leave = self.problem.work_of_adhesion == 0 and not control.is_fixed
            if may_leave and not self.edges.solution(start, d).edge_opening.mean() <= 0:
                raise PathError(
                    "without adhesion the method 'sharp' finds no first patches under a load, or "
                    "where a soft stiffness holds the solid; the method 'grid' does"
                )
            event = Event(self.detached(touch / self.q0), d, gaps, start)
            point = history.commit(self.jumps.compute(event, target.direction))
        else:
            gaps = state.internal.gaps
            if point is None:
                point = self.edges.equilibrium(gaps, d, self.edges.longest_step)
            else:
                d = point.d  # that of the state but for rounding
            if point is None:
                field = self.edges.field(gaps, d)
                before = self.states.of_point(Point(d, field, np.zeros(gaps.size), math.nan))
                event = Event(before, d, gaps, gaps)
                point = history.commit(self.jumps.compute(event, target.direction))
            elif d == target.d:
                history.states.append(state)
        while point is not None and d != target.d:
            d, point = self.follower.run(history, point, target)
        if point is None and d != target.d and not control.is_load:
            if self.edges.critical > 0 and self.states.attracts_when_detached(min(d, target.d)):
                raise NoState("contact is lost where surfaces overlap", d)
            history.states.append(self.detached(target.prescribed))
        return history

    def _follow_reversibly(self, state: ContactState, target: Target) -> Path:
        """Follow a path without adhesion, whose states are unique and do not jump.

        On loading patches appear, grow and merge smoothly. Unloading goes back through the states
        of loading; a missing state is reached by loading from a lighter one.
        """
        prescribed_in = self.problem.prescribed_in
        if target.direction == "loading":
            states = self._history(state, target).states
            begin = prescribed_in(state)
            self._loaded = [s for s in self._loaded if prescribed_in(s) >= begin] + states
            return Path(tuple(states), ())
        lighter = [s for s in self._loaded if prescribed_in(s) >= target.prescribed]
        start = prescribed_in(state)
        back = [s for s in self._loaded if start < prescribed_in(s) < target.prescribed]
        apart = self.problem.detached_separation(state, target.prescribed)
        first = self.detached(max(apart, self.problem.profile.h_max))
        last = min(lighter, key=prescribed_in, default=first)
        if prescribed_in(last) > target.prescribed:
            last = self._history(last, replace(target, direction="loading")).states[-1]
        back.reverse()  # states at one prescribed value come in the order opposite to loading
        return Path((*sorted(back, key=prescribed_in), last), ())
