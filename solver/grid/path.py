"""The path of the method ``grid`` between two separations, with location of the jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.grid.contact import Contact
from solver.grid.edges import patch_ranges
from solver.grid.relax import Relaxation
from solver.grid.states import state_of
from solver.jumps import Branch, Jump
from solver.method import ContactState
from solver.problem import Problem


@dataclass
class Counters:
    """What the path cost: sub-steps taken, and those that were halved."""

    substeps: int = 0
    bisections: int = 0


class Steps:
    """Sub-steps of one call of ``follow``, with location of the jumps.

    Between two separations Δs apart the energy of the frozen edges less that of the relaxed ones is
    D. With p̄ the mean stresses, edges that move smoothly give D = ½ λ|Δs||p̄_frozen - p̄_relaxed|,
    so the excess X = D - that is of third order in Δs: a measure of the error of the trapezoidal
    rule, and of the audit. If even D - λ|Δs||p̄_frozen - p̄_relaxed| > 0, the new contact set has
    less energy than the old one already at the old separation: the path has left its local minimum
    there or in between, which is a jump.
    """

    def __init__(
        self,
        problem: Problem,
        relaxation: Relaxation,
        accuracy: float,
        branch: Branch,
        count: Counters,
    ) -> None:
        self.relaxation, self.lattice = relaxation, relaxation.lattice
        self.solver = relaxation.solver
        self.profile = problem.profile
        self.accuracy = accuracy
        self.branch = branch
        self.count = count
        self.states: list[ContactState] = []
        self.jumps: list[Jump] = []
        self.energy = self.lattice.energy
        self.period = problem.profile.period
        self.h_max = problem.profile.h_max
        self.adhesion_scale = problem.work_of_adhesion * self.period

    def first_touch(self, separation: float) -> Contact:
        """Contact at the separation at which the highest crests touch."""
        contact = self.solver.empty(separation)
        before = state_of(self.lattice, contact)
        self.states.append(before)
        crests = np.rint(self.profile.crests().position / self.lattice.dx).astype(np.intp)
        contact.mask[crests % self.lattice.n] = True
        self.solver.solve(contact, self.relaxation.tight)
        if self.energy(contact) < 0:
            relaxed = self.relaxation.relax(contact)
            assert relaxed is not None
            contact = relaxed
            self._jump(before, contact)
        else:
            contact = self.solver.empty(separation)
        return contact

    def run(self, contact: Contact, separation: float) -> None:
        """Go from a relaxed contact to ``separation``, appending states and jumps."""
        start = contact.separation
        step = separation - start
        # Below this stride a jump is run to its end: only then is it known how well it is located.
        self.least = self.accuracy * self.h_max
        while contact.separation != separation:
            remaining = separation - contact.separation
            if abs(step) >= abs(remaining) * (1 - 1e-9):
                step, target = remaining, separation
            else:
                target = contact.separation + step
            if abs(target - separation) < 1e-12 * self.h_max:
                target = separation
            after, located = self._substep(contact, target, abs(step) > self.least)
            if after is None:
                self.count.bisections += 1
                step /= 2
                continue
            self.count.substeps += 1
            if not located:
                self.states.append(state_of(self.lattice, after))
            contact = after
            step *= 2
        if not self.states or self.states[-1].separation != separation:
            self.states.append(state_of(self.lattice, contact))

    def _substep(
        self, contact: Contact, target: float, divisible: bool
    ) -> tuple[Contact | None, bool]:
        """One step to ``target``: the relaxed contact, and whether it jumped.

        No contact: the step must be halved. A jump's two states are appended here.
        """
        accuracy, relaxation = self.accuracy, self.relaxation
        stride = abs(target - contact.separation)
        frozen = contact.copy()
        frozen.separation = target
        if self.adhesion_scale == 0:
            return relaxation.relax_without_adhesion(frozen), False
        self.solver.solve(frozen, relaxation.tight)
        energy = self.energy(frozen)
        stress = float(frozen.stress.mean())
        work = self.period * stride
        noise = 1e-5 * accuracy * self.adhesion_scale

        def jumped(now: float, relaxing: Contact) -> bool:
            change = abs(stress - float(relaxing.stress.mean()))
            return energy - now - work * change > noise

        flips = relaxation.flips
        relaxed = relaxation.relax(frozen, jumped if divisible else None)
        if relaxed is None:
            return None, False
        flips = relaxation.flips - flips
        drop = energy - self.energy(relaxed)
        change = stress - float(relaxed.stress.mean())
        if jumped(self.energy(relaxed), relaxed):
            allowed = max(2 * accuracy * drop, 0.02 * accuracy * self.adhesion_scale)
            if work * abs(change) > allowed and stride > 0.01 * accuracy * self.h_max:
                self.least = min(0.5 * stride, allowed / (self.period * abs(change)))
                return None, False
            before = state_of(self.lattice, frozen)
            self.states.append(before)
            self._jump(before, relaxed)
            return relaxed, True
        smooth = 0.5 * work * (change if self.branch == "loading" else -change)
        # One node more or less at each edge is the grid's own unrest, not curvature.
        unrest = (
            0.25 * abs(smooth) * min(1.0, 2 * patch_ranges(frozen.mask)[0].size / max(flips, 1))
        )
        allowed = 0.3 * accuracy * self.adhesion_scale * stride / self.h_max + unrest
        if abs(drop - smooth) > allowed and divisible:
            return None, False
        return relaxed, False

    def _jump(self, before: ContactState, after: Contact) -> None:
        state = state_of(self.lattice, after)
        self.states.append(state)
        self.jumps.append(Jump.between(before, state, self.branch, self.period))
