"""Follow the path of the method ``zones`` to a prescribed value, and locate its jumps."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.method import ContactState, PathError
from adhesis.solver.model.jump import Branch, Jump
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.peaks import patch_ranges
from adhesis.solver.zones.descent import Descent, Minimum
from adhesis.solver.zones.resolution import relative_error
from adhesis.solver.zones.surface import sharpened

_FINEST = 1e-3  # of γ, or the accuracy: unit of the next two
_SMOOTH = 0.1  # of the unit, shared by the range: loss of a step that counts as none
_NOISE = 0.01  # of the unit: loss of a step by a node that comes into contact or zone
_BENT = 0.2  # of what ΔY Δx is off the slopes: counts as a loss of a step
_LOCATED = 0.3  # of the accuracy times the drop, or of the noise: work within which a jump lies
_SETTLED = 0.01  # of that: work within which a jump lies that races
_LONGEST = 0.05  # of the range: jumps hide in longer steps
_NEAREST = 1e-9  # of the range: shortest step
_MOVED = 0.1  # of the range of adhesion: gaps of two minima differ by more
_WIDEST_EDGE = 0.99  # nodes between an edge and the next free node, at most


class Steps:
    """Steps of one call of ``follow``, with location of the jumps.

    Let L be what a step loses: the fall of the potential W less ∫ Y dx, by stresses and their
    slopes at both its ends. On a branch L is of fifth order in the step, and ΔY less that of the
    slopes of third order: a jump may hide in one of both. A step with a larger one is halved until
    the work |ΔY Δx| within which the jump lies is small beside its drop. A descent on the way to
    that is ended as soon as W is below what a branch may have; then each step is half of the last.
    """

    def __init__(self, problem: Problem, descent: Descent, accuracy: float, branch: Branch) -> None:
        self.problem, self.descent, self.accuracy, self.branch = problem, descent, accuracy, branch
        self.surface = descent.surface
        self.states: list[ContactState] = []
        self.jumps: list[Jump] = []
        self.error, self.by_nodes = 0.0, relative_error(problem, descent.surface.dx)
        self.scale = problem.prescribed_range + problem.attraction_range
        if problem.control.is_load:
            self.scale = problem.prescribed_range
        self.unit = min(accuracy, _FINEST) * problem.work_of_adhesion

    def run(self, here: Minimum, prescribed: float) -> None:
        """Follow the path from a minimum to x = ``prescribed``, appending states and jumps.

        Raises
        ------
        PathError
            If the contact runs into full contact, or no minimum is found.
        """
        control = self.problem.control
        longest = _LONGEST * self.scale
        whole = step = float(np.clip(prescribed - here.prescribed, -longest, longest))
        rate, slope = self._rate(here)
        least, growth = self.accuracy * self.scale, 2.0
        while here.prescribed != prescribed:
            remaining = prescribed - here.prescribed
            if abs(step) >= abs(remaining) * (1 - 1e-9):
                step = remaining
            target = prescribed if step == remaining else here.prescribed + step
            divisible = abs(step) > least
            after = self._descend(here, rate, slope, target, divisible)
            if after is None:
                step, growth = 0.5 * step, 0.5
                continue
            if not (control.is_fixed or after.gap.any()):
                raise PathError(self.problem.full_contact(target))
            lost = control.is_load and target > 0 and after.adhesion == 0
            rate_after, slope_after = (rate, slope) if lost else self._rate(after)
            change = self._conjugate(after) - self._conjugate(here)
            loss = here.potential - after.potential
            loss -= (self._conjugate(here) + 0.5 * change) * step
            smooth = loss + (slope_after - slope) * step**2 / 12
            allowed = self.unit * (_SMOOTH * abs(step) / self.scale + _NOISE)
            bent = abs((change - 0.5 * (slope + slope_after) * step) * step)
            within = max(abs(change * step), bent)
            begins_or_ends = (after.adhesion == 0) != (here.adhesion == 0)
            # on a branch on which Y rises or falls the trapezoidal rule is off by half of that
            by_rule = loss - 0.5 * abs(change * step)
            if begins_or_ends or max(abs(smooth), by_rule, _BENT * bent) > allowed:
                located = _LOCATED * max(self.accuracy * abs(loss), _NOISE * self.unit)
                start = here.gap + rate * step
                at_stake = None if within > located else self._at_stake(start, after)
                located *= 1.0 if at_stake is None else _SETTLED
                if (lost or within > located) and abs(step) > _NEAREST * self.scale:
                    # the separation at the loss of contact varies as a square root of the load
                    wanted = 0.0 if lost else abs(step) * located / within
                    least = min(0.5 * abs(step), max(wanted, _NEAREST * self.scale))
                    step *= 0.5
                    continue
                self._jump(here, after, (slope, slope_after), start, at_stake)
                self.error += self.by_nodes * abs(self.jumps[-1].energy_drop)
                if lost:
                    self.error += self._misplaced(here.separation, target)
                    return
                self.error += within
                step, least, growth = whole, self.accuracy * self.scale, 2.0
            else:
                self.states.append(self.state_of(after, slope_after))
                step = float(np.clip(growth * step, -longest, longest))
                growth = growth if abs(step) > least else 2.0
            here, rate, slope = after, rate_after, slope_after

    def _misplaced(self, separation: float, load: float) -> float:
        """Estimate the work in J/m² by which nodes misplace a loss of contact under a load, in Pa.

        They do so by a share of the load; the separation varies as a square root of what is left.
        """
        seen = np.array([(-s.mean_stress, s.separation) for s in self.states[:-1]]).T
        return load * abs(separation - float(np.interp((1 - self.by_nodes) * load, *seen)))

    def _rate(self, here: Minimum) -> tuple[Array, float]:
        """Return dg/dx and dY/dx; where nothing is attracted the gap follows what is prescribed."""
        if here.adhesion == 0:
            return np.full(self.surface.n, float(not self.problem.control.is_load)), 0.0
        return self.descent.rate(here)

    def _conjugate(self, here: Minimum) -> float:
        return self.problem.control.conjugate(
            here.separation, here.mean_stress, self.problem.profile.h_max
        )

    def _descend(
        self, here: Minimum, rate: Array, slope: float, target: float, divisible: bool
    ) -> Minimum | None:
        """Descend at ``target``; None if the step has to be divided."""
        step = target - here.prescribed
        fall = self._conjugate(here) * step + 1.5 * abs(slope) * step**2 + 2 * _NOISE * self.unit
        least = here.potential - fall if divisible else -math.inf
        return self.descent.run(here.gap + step * rate, target, least)

    def _at_stake(self, start: Array, after: Minimum) -> float | None:
        """Energy in J/m² by which a jump ends elsewhere with a viscous interface, or None.

        Where it ends near its start the fold is too near to be passed. Under a load no order of
        events decides.
        """
        if self.problem.control.is_load:
            return None
        other = self.descent.run(start, after.prescribed, by_interface=True)
        if other is None:
            return None
        apart = min(np.abs(other.gap - gap).max() for gap in (start, after.gap))
        moved = apart > _MOVED * self.surface.range
        return abs(other.potential - after.potential) if moved else None

    def _jump(
        self, here: Minimum, after: Minimum, slopes: tuple[float, float], start: Array,
        at_stake: float | None,
    ) -> None:  # fmt: skip
        """Append a jump that lies between two minima, at the prescribed value of the second.

        The state before it is ``start``: a stiff machine would load the gap of ``here`` far more
        than the branch. Under a load W of a gap is linear in the load, and that of ``here`` exact.
        """
        x = after.prescribed
        gap = here.gap if self.problem.control.is_load else np.maximum(start, 0.0)
        last = self.descent.at(gap, x) if here.adhesion else replace(here, prescribed=x)
        before, end = self.state_of(last, slopes[0]), self.state_of(after, slopes[1])
        lost = self.problem.control.is_load and x > 0 and after.adhesion == 0
        if lost:
            end = ContactState.detached(before.separation)
        self.states += [before, end]
        if not before.contact_fraction:
            before = replace(before, edges=np.empty((0, 2)))
        jump = Jump.between(
            before, end, self.branch, self.surface.period, raced=at_stake is not None,
            at_stake=at_stake or 0.0, opens=_opens(here.gap, after.gap), falls_off=lost,
        )  # fmt: skip
        self.jumps.append(jump)

    def state_of(self, here: Minimum, slope: float) -> ContactState:
        """Make the contact state of a minimum with dY/dx = ``slope``.

        Where nothing touches, zones count as patches.
        """
        surface, control = self.surface, self.problem.control
        if here.adhesion == 0:
            return ContactState.detached(here.separation if control.is_load else here.prescribed)
        contact = here.gap == 0
        first, width = patch_ranges(contact)
        left, right = _beyond(here.gap, first, -1), _beyond(here.gap, first + width - 1, 1)
        edges = np.column_stack([first - 1 + left, first + width - right])
        length = float((edges[:, 1] - edges[:, 0]).sum())
        if not contact.any():
            first, width = patch_ranges(sharpened(here.gap) < surface.range)
            edges = np.column_stack([first - 0.5, first + width - 0.5])
        edges = edges * surface.dx
        edges += surface.period * ((edges[:, :1] < 0) * 1.0 - (edges[:, :1] >= surface.period))
        hold = control.potential(
            0.0, here.separation, here.mean_stress, self.problem.profile.h_max, surface.period
        )
        return ContactState(
            separation=here.separation,
            edges=edges[np.argsort(edges[:, 0], kind="stable")],
            mean_stress=here.mean_stress,
            elastic_energy=here.elastic * surface.period,
            adhesion_energy=here.adhesion * surface.period,
            contact_fraction=length / surface.n,
            tangent=slope,
            hold_energy=hold,
            internal=here.gap,
        )


def _beyond(gap: Array, node: NDArray[np.intp], way: int) -> Array:
    """Distance of edges from the first free node in nodes: the gap rises as its power 3/2."""
    n = len(gap)
    near, far = gap[(node + way) % n], gap[(node + 2 * way) % n]
    ratio = np.cbrt(near / np.maximum(np.maximum(near, far), np.finfo(float).tiny)) ** 2
    return np.asarray(np.clip(ratio / np.maximum(1 - ratio, 1e-12), 0.0, _WIDEST_EDGE))


def _opens(before: Array, after: Array) -> bool:
    """Whether a gap appears inside a patch: one all of whose nodes, and both beside, touched."""
    gaps = zip(*patch_ranges(after > 0), strict=True)
    return any(not before.take(range(k - 1, k + m + 1), mode="wrap").any() for k, m in gaps)
