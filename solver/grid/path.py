"""Follow the path of the method ``grid`` to a prescribed value, and locate its jumps."""

from __future__ import annotations

import numpy as np

from adhesis.solver.grid.contact import Contact
from adhesis.solver.grid.relax import Relaxation
from adhesis.solver.grid.states import state_of
from adhesis.solver.method import ContactState, PathError
from adhesis.solver.model.jump import Branch, Jump
from adhesis.solver.model.problem import Problem
from adhesis.solver.peaks import patch_ranges

# Relative error of a drop times the number of nodes in half the first equilibrium width on a crest
# of rms curvature. How often it holds: docs/methods.md, "How far the reported error holds".
_COARSE = 0.6
# Drop of a patch that comes or goes, over γ times that half-width: up to 1.5 at the touch of a
# parabola, and more where surfaces that touch are flatter than crests are.
_UNSEEN = 2.0
_OVERLAP = 1e-6  # of h_max: a smaller overlap counts as touch
_NEAREST = 1e-8  # of the range: resolution of the location of first touch
_LEAST_DISPLACEMENT = 0.1  # shortest waves between edges of different minima
_FEWEST_NODES_APART = 2
_LONGEST = 0.05  # of the range: jumps hide in longer steps, where D is smooth by chance


class Steps:
    """Sub-steps of one call of ``follow``, with location of the jumps.

    Let D be the energy with fixed edges less that with relaxed edges after a step Δs, and p̄ the
    mean stresses. Edges that move smoothly give D = ½ λ|Δs||p̄_fixed - p̄_relaxed|; the difference
    of the two sides is of third order in Δs and measures the error of the trapezoidal rule and of
    the audit. If even D - λ|Δs||p̄_fixed - p̄_relaxed| > 0, the new contact set has less energy than
    the old one already at the old separation: the local minimum became unstable in this step, which
    is a jump.
    """

    def __init__(
        self,
        problem: Problem,
        relaxation: Relaxation,
        accuracy: float,
        branch: Branch,
    ) -> None:
        self.relaxation, self.lattice = relaxation, relaxation.lattice
        self.solver = relaxation.solver
        self.profile = problem.profile
        self.accuracy = accuracy
        self.branch = branch
        self.states: list[ContactState] = []
        self.jumps: list[Jump] = []
        self.error = 0.0
        self.share = 0.5  # factor by which a rejected step is shortened
        self.last: tuple[Contact, Contact] | None = None  # start and fixed-edge end of a step
        self.reached = np.nan  # prescribed value of the last state
        self.energy = self.lattice.energy
        self.period = problem.profile.period
        self.problem = problem
        self.scale = problem.prescribed_range
        self.adhesion_scale = problem.work_of_adhesion * self.period
        # Relative error of a drop, and size in J/m² of the drop in which a patch appears.
        self.coarse = self.least_drop = 0.0
        if self.adhesion_scale:
            # half of the first equilibrium width of a patch on a crest of rms curvature κ, nearly
            # (16 Γ/(π κ²))^(1/3) in units of 1/q0, Γ = 2γq0/E* (docs/methods.md, "Resolution")
            rigidity = problem.half_space.modulus * problem.profile.m4
            half_width = float(np.cbrt(32 * problem.work_of_adhesion / (np.pi * rigidity)))
            self.coarse = _COARSE * self.lattice.dx / half_width
            self.least_drop = _UNSEEN * problem.work_of_adhesion * half_width / self.period
        # Displacement, in nodes, beyond which an edge has run and two end states are different
        # minima.
        wave = problem.shortest_wavelength / self.lattice.dx
        self.min_displacement = max(_FEWEST_NODES_APART, _LEAST_DISPLACEMENT * wave)

    def first_touch(self, separation: float) -> Contact:
        """Return the contact at the separation at which the highest crest touches."""
        contact = self.solver.empty(separation)
        before = state_of(self.lattice, contact)
        self.states.append(before)
        position = self.profile.crests().position
        if self.adhesion_scale:
            position = position[self.problem.first_of_equal(position, self.problem.equal_parts)]
        crests = np.rint(position / self.lattice.dx).astype(np.intp)
        contact.mask[crests % self.lattice.n] = True
        self.solver.solve(contact, self.relaxation.tight)
        if self.energy(contact) >= 0:
            return self.solver.empty(separation)
        relaxed = self.relaxation.relax(contact)
        assert relaxed is not None
        self._jump(before, contact, relaxed)
        return relaxed

    def run(self, contact: Contact, prescribed: float) -> None:
        """Follow the path from a relaxed contact to x = ``prescribed``, appending states and jumps.

        Raises
        ------
        PathError
            If the contact runs into full contact, which is possible if the separation is not fixed.
        """
        control = self.lattice.control
        step = prescribed - contact.prescribed
        # In shorter steps a jump is relaxed to its end, which shows how precisely it is located.
        self.least = self.accuracy * self.scale
        longest = _LONGEST * self.scale if self.adhesion_scale else np.inf
        while contact.prescribed != prescribed:
            remaining = prescribed - contact.prescribed
            step = float(np.clip(step, -longest, longest))
            if abs(step) >= abs(remaining) * (1 - 1e-9):
                step, target = remaining, prescribed
            else:
                target = contact.prescribed + step
            if abs(target - prescribed) < 1e-12 * self.scale:
                target = prescribed
            after, located = self._substep(contact, target, abs(step) > self.least)
            if after is None:
                step *= self.share
                continue
            if not located:
                # With adhesion no patch comes or goes without a jump: where a few nodes make one
                # it does so smoothly, and its drop is lost.
                one, other = (patch_ranges(state.mask)[0].size for state in (contact, after))
                self.error += self.least_drop * abs(one - other)
                self._append(after)
            contact = after
            if not control.is_fixed and np.count_nonzero(~contact.mask) <= 1:
                raise PathError(self.problem.full_contact(target))
            if control.is_load and not contact.mask.any():
                return  # the solid has fallen off
            step *= 2
        if not self.states or self.reached != prescribed:
            self._append(contact)

    def _substep(
        self, contact: Contact, target: float, divisible: bool
    ) -> tuple[Contact | None, bool]:
        """Take one step to ``target``; returns the relaxed contact, and whether it jumped.

        The contact is None if the step must be shortened. The two states of a jump are appended.
        """
        accuracy, relaxation = self.accuracy, self.relaxation
        self.share = 0.5
        stride = abs(target - contact.prescribed)
        frozen = self._frozen(contact, target)
        if self.adhesion_scale == 0:
            return relaxation.relax_without_adhesion(frozen), False
        self.solver.solve(frozen, relaxation.tight)
        self.last = contact, frozen
        energy = self.energy(frozen)
        conjugate = self.lattice.conjugate(frozen)
        work = self.period * stride
        noise = 1e-5 * accuracy * self.adhesion_scale

        def jumped(now: float, relaxing: Contact) -> bool:
            """Return whether the new contact set has less energy already before the step."""
            change = abs(conjugate - self.lattice.conjugate(relaxing))
            return energy - now - work * change > noise

        touched = self._touched(contact, frozen)
        overlaps = touched < 1 and stride > _NEAREST * self.scale
        flips = relaxation.flips
        relaxed = relaxation.relax(frozen, jumped if divisible or overlaps else None)
        if relaxed is None:
            if overlaps:
                # Surfaces must not overlap in any returned state.
                self.share = touched
                if not divisible:
                    self.least = 2 * touched * stride
            return None, False
        flips = relaxation.flips - flips
        drop = energy - self.energy(relaxed)
        change = conjugate - self.lattice.conjugate(relaxed)
        if jumped(self.energy(relaxed), relaxed):
            allowed = max(2 * accuracy * drop, 0.02 * accuracy * self.adhesion_scale)
            least = 0.01 * accuracy * self.scale
            if self.lattice.control.is_load and not relaxed.mask.any():
                # The separation at the loss of contact varies as a square root of the load.
                allowed, least = 0.0, 0.01 * accuracy * least
            if work * abs(change) > allowed and stride > least:
                wanted = allowed / (self.period * abs(change)) if allowed else least
                self.least = min(0.5 * stride, wanted)
                return None, False
            before = state_of(self.lattice, frozen)
            self.states.append(before)
            self._jump(before, frozen, relaxed)
            self.error += stride * abs(change)
            return relaxed, True
        smooth = 0.5 * work * (change if self.branch == "loading" else -change)
        # One node more or less at each edge is noise of the discretisation, not curvature.
        grid_noise = (
            0.25 * abs(smooth) * min(1.0, 2 * patch_ranges(frozen.mask)[0].size / max(flips, 1))
        )
        allowed = 0.3 * accuracy * self.adhesion_scale * stride / self.scale + grid_noise
        if abs(drop - smooth) > allowed and divisible:
            return None, False
        return relaxed, False

    def _frozen(self, contact: Contact, target: float) -> Contact:
        """Return an unsolved contact with the same edges at x = ``target``.

        As the stress is linear in x, the initial guess interpolates the last, longer step.
        """
        frozen = contact.copy()
        frozen.prescribed = target
        if self.lattice.control.is_fixed:
            frozen.separation = target
        if self.last is not None and self.last[0] is contact:
            far = self.last[1]
            share = (target - contact.prescribed) / (far.prescribed - contact.prescribed)
            frozen.stress += share * (far.stress - contact.stress)
            frozen.displacement += share * (far.displacement - contact.displacement)
            if contact.response is not None:
                frozen.separation += share * (far.separation - contact.separation)
        return frozen

    def _touched(self, contact: Contact, frozen: Contact) -> float:
        """Compute the share of the step to ``frozen`` at which the overlap is half the allowed one.

        Gaps are linear in x with fixed edges. 1 if the overlap stays within the allowed one.
        """
        most = _OVERLAP * self.profile.h_max
        start, end = self.lattice.gap(contact), self.lattice.gap(frozen)
        over = np.flatnonzero(~frozen.mask & (end < -most))
        if over.size == 0:
            return 1.0
        share = (start[over] + 0.5 * most) / (start[over] - end[over])
        return float(np.clip(share.min(), 0.01, 0.95))

    def _alternative(self, start: Contact, after: Contact) -> Contact | None:
        """Find the end state reached with equal speeds; None if it is the same minimum.

        It can differ only if several edges ran, or surfaces touched.
        """
        if start.mask.any():
            first, width = patch_ranges(start.mask ^ after.mask)
            beside = np.array([first, first - 1, (first + width) % start.mask.size])
            touched = not start.mask[beside].any(axis=0).all()  # what ran is beside no patch
            if np.count_nonzero(width > self.min_displacement) < 2 and not touched:
                return None
        other = self.relaxation.relax(
            start, lambda _, running: self._is_same_minimum(running, after), equal_speeds=True
        )
        return None if other is None or self._is_same_minimum(other, after) else other

    def _is_same_minimum(self, one: Contact, other: Contact) -> bool:
        """Return True if no edge is far from its position in the other contact set."""
        return bool(patch_ranges(one.mask ^ other.mask)[1].max(initial=0) <= self.min_displacement)

    def _append(self, contact: Contact) -> ContactState:
        """Append the state of a relaxed contact, and return it."""
        state = state_of(self.lattice, contact)
        self.states.append(state)
        self.reached = contact.prescribed
        return state

    def _jump(self, before: ContactState, start: Contact, after: Contact) -> None:
        """Append the jump to ``after``, the minimum reached by descent from ``start``."""
        other = self._alternative(start, after)
        lost = self.lattice.control.is_load and not after.mask.any()
        if lost:
            after.separation = before.separation
            # The loop is closed at this separation; edges may have a node left to the fold.
            nearer = start.copy()
            nearer.mask = start.mask & np.roll(start.mask, 1) & np.roll(start.mask, -1)
            if nearer.mask.any():
                self.solver.solve(nearer, self.relaxation.tight)
                later = abs(nearer.separation - before.separation)
                self.error += abs(before.mean_stress) * later
        end = self._append(after)
        at_stake = 0.0
        if other is not None:
            at_stake = abs(self.energy(other) - self.energy(after)) / self.period
        jump = Jump.between(
            before, end, self.branch, self.period, raced=other is not None, at_stake=at_stake,
            falls_off=lost,
        )  # fmt: skip
        self.error += self.coarse * abs(jump.energy_drop)
        self.jumps.append(jump)
