"""Johnson's closed form of the single wave as a method.

With this reference, exact to rounding, the errors of the loading path and the audit (``loop``) can
be measured alone, and other methods compared state by state. The adhesive area is measured along
the profile, as ``problem.Problem`` defines it.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from adhesis.solver.method import (
    ContactState,
    Fields,
    Method,
    MethodReport,
    Opening,
    Path,
    PathError,
)
from adhesis.solver.model.jump import Jump
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.references.single_wave import SingleWave, WaveLoop


@dataclass(frozen=True)
class ExactWaveReport(MethodReport):
    states_per_step: int


class ExactWave(Method):
    """Johnson's single wave as a ``method.Method``.

    ``follow`` returns ``states_per_step`` states along the branch, evenly spaced in the contact
    half-width, of which p̄ and s are smooth functions even at the fold.
    """

    name: ClassVar[str] = "exact wave"

    def __init__(self, problem: Problem, *, states_per_step: int = 32) -> None:
        super().__init__(problem)
        if problem.highest_harmonic != 1 or problem.pattern is not None:
            raise ValueError("the exact wave needs a profile of harmonic 1 alone, and one γ")
        self.states_per_step = states_per_step
        self.crest, amplitude = problem.profile.highest_point
        self.wave = SingleWave(
            amplitude,
            problem.profile.period,
            problem.half_space.modulus,
            problem.work_of_adhesion,
            measure=problem.measure,
        )

    def follow(self, state: ContactState, prescribed: float) -> Path:
        control, amplitude = self.problem.control, self.wave.amplitude
        branch = self.problem.branch_to(state, prescribed)
        states: list[ContactState] = []
        jumps: list[Jump] = []
        first = control.prescribed(amplitude, 0.0)
        apart = self.problem.detached_separation(state, prescribed)
        if not state.patches:
            if prescribed > first or self._contact_width(prescribed) == 0:
                return Path((self.detached(apart),), ())
            before = self.detached(amplitude)
            state = self._state(self._loop.touch_half_width)
            states += [before, state]
            if state.patches:
                jumps.append(Jump.between(before, state, branch, self.wave.period))
            if prescribed == first:
                return Path(tuple(states), tuple(jumps))
        a_from = state.internal or 0.0  # without adhesion contact grows from a point
        a_to = self._contact_width(prescribed)
        widths = np.linspace(a_from, a_to, self.states_per_step + 1)[1:]
        states += self._states(widths[:-1])
        loop = self._loop
        end = control.prescribed(loop.fold_separation, loop.fold_mean_stress)
        if prescribed > end:
            before = self._state(loop.fold_half_width)
            after = self.detached(loop.fold_separation if control.is_load else end)
            states += [before, after]
            if not control.is_load:
                states.append(self.detached(prescribed))
            if before.patches:
                period, falls_off = self.wave.period, control.is_load
                jumps.append(Jump.between(before, after, branch, period, falls_off=falls_off))
        else:
            states.append(self._state(a_to, prescribed if control.is_fixed else None))
        return Path(tuple(states), tuple(jumps))

    def fields(self, state: ContactState, n: int) -> Fields:
        """Compute the exact fields on n nodes; the stress of a node on an edge is 0."""
        x = self.problem.profile.period * np.arange(n) / n
        height = self.problem.profile.at(x)
        if not state.patches:
            zero = np.zeros(n)
            return Fields(x, height, zero, zero, state.separation - height)
        gap = self.wave.gap(x - self.crest, state.internal)
        stress = self.wave.stress(x - self.crest, state.internal)
        return Fields(x, height, stress, gap + height - state.separation, gap)

    def openings(self, state: ContactState) -> list[Opening]:
        """Compute the opening of the only gap by the closed form."""
        if not state.patches:
            return []
        a, period = state.internal, self.problem.profile.period
        phi = np.linspace(0, np.pi, 2001)
        x = period / 2 - (period / 2 - a) * np.cos(phi)
        return [Opening(self.crest + x, self.wave.gap(x, a))]

    def report(self) -> ExactWaveReport:
        return ExactWaveReport(self.name, self.chosen, self.states_per_step)

    @cached_property
    def _loop(self) -> WaveLoop:
        control = self.problem.control
        return self.wave.loop if control.is_fixed else self.wave.loop_under(control.stiffness)

    def _contact_width(self, prescribed: float) -> float:
        """Compute the half-width at x = ``prescribed``; beyond the branch, that at its end."""
        control, loop = self.problem.control, self._loop
        end = control.prescribed(loop.fold_separation, loop.fold_mean_stress)
        if control.is_fixed:
            return self.wave.half_width(min(prescribed, end))
        if prescribed >= end:
            return loop.fold_half_width
        value = -prescribed if control.is_load else self.wave.amplitude - prescribed
        try:
            return self.wave.half_width_under(control.stiffness, value)
        except ValueError:
            raise PathError(self.problem.full_contact(prescribed)) from None

    def _state(self, a: float, separation: float | None = None) -> ContactState:
        (state,) = self._states(np.array([a]), separation)
        return state

    def _states(self, widths: Array, separation: float | None = None) -> list[ContactState]:
        """Compute the states with the half-widths, by default on the equilibrium branch."""
        wave = self.wave
        s = wave.separation(widths) if separation is None else np.full(widths.size, separation)
        adhesion, energy = wave.adhesion_energy(widths), wave.energy(widths)
        columns = (widths, s, wave.mean_stress(widths), energy - adhesion, adhesion)
        return [self._state_of(*values) for values in np.column_stack(columns).tolist()]

    def _state_of(
        self, a: float, s: float, stress: float, elastic: float, adhesion: float
    ) -> ContactState:
        if a == 0:
            return self.detached(s)
        period = self.wave.period
        left = (self.crest - a) % period
        control = self.problem.control
        return ContactState(
            separation=s,
            edges=np.array([[left, left + 2 * a]]),
            mean_stress=stress,
            elastic_energy=elastic,
            adhesion_energy=adhesion,
            contact_fraction=2 * a / period,
            hold_energy=control.potential(0.0, s, stress, self.wave.amplitude, period),
            internal=a,
        )
