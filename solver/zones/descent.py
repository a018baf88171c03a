"""Descent of a gap to the next minimum of its energy, at a prescribed separation or load.

The flow of least energy through a viscosity, V ġ = -∂U/∂g, by linearly implicit steps (V/Δt + H) Δg
= -∂U/∂g on the nodes that are not in contact, by conjugate gradients. Where nothing runs, Δt is
infinite: that is Newton's method. V is that of the interface, the same at all nodes, or that of the
solid, K itself. Which minimum is reached does not depend on the steps: they are short where H is
not positive, and none moves a node by more than half the range, or half of what it is beyond it.

Contact nodes are those with g = 0 that are pressed; one that is pulled by more than the strength
opens, so that contact, zones and openings need no rule of their own.

With a stiffness k of what holds the solid the mean gap s is free, and ½k(s - x)² is added to U;
under a load p̄ it is p̄ s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from adhesis.solver.method import PathError
from adhesis.solver.model.control import Control
from adhesis.solver.model.profile import Array
from adhesis.solver.zones.surface import Surface, ZoneEnds, product

_LONGEST = 0.5  # of the range, or of the gap beyond it: way of a node in one step
_BALANCED = 1e-6  # of the strength: residual of a minimum
_ROUNDING = 64.0  # units of rounding of the heights, by which forces may be off
_ITERATIONS = 200  # of conjugate gradients in one step
_LOOSE = 0.1  # of the residual, to which a correction is solved far from a minimum
_RATE = 1e-6  # of its residual, to which the rate of a branch is solved
_STALLED = 1e3  # times that of a minimum: residual where the energy falls no more
_MOST_STEPS = 200_000
_SLOWER, _FASTER = 2.0, 0.3  # times the damping 1/Δt after a step uphill, at least after others
_AIM = 0.7  # of the longest way: that of the next step
_LEAST_DAMPING, _MOST_DAMPING = 1e-6, 1e8  # of the stiffness of the longest wave


@dataclass(frozen=True, eq=False)
class Minimum:
    """A minimum of the energy, or a gap on the way to it.

    Attributes
    ----------
    gap : array, shape (n,)
        In m.
    prescribed : float
        x of the control.
    separation, mean_stress : float
        In m and Pa.
    elastic, adhesion, potential : float
        Energies, the last of the control, in J/m² of nominal area.
    free : array, shape (n,)
        1 at the nodes that may move, 0 at those in contact.
    residual : array, shape (n,)
        What is out of balance at free nodes, in Pa.
    ends : ZoneEnds
    """

    gap: Array
    prescribed: float
    separation: float
    mean_stress: float
    elastic: float
    adhesion: float
    potential: float
    free: Array
    residual: Array
    ends: ZoneEnds


class Descent:
    """Minimisation of the energy of one surface under one control; counts its steps."""

    def __init__(self, surface: Surface, control: Control, h_max: float) -> None:
        self.surface, self.control, self.h_max = surface, control, h_max
        self.steps = 0
        self.rounding = _ROUNDING * np.finfo(float).eps * h_max * float(surface.stiffness[-1])
        self.balanced = max(_BALANCED * float(surface.strength.min()), self.rounding)

    def run(
        self, gap: Array, x: float, least: float = -math.inf, *, by_interface: bool = False
    ) -> Minimum | None:
        """Descend from a gap to the minimum at the prescribed value ``x``.

        None if the potential falls below ``least`` on the way. Under a tension that nothing carries
        the gap is returned at which the solid falls off.

        Raises
        ------
        PathError
            If there is no minimum within the largest number of steps, or the energy falls no more.
        """
        here = self.at(np.maximum(gap, 0.0), x)
        symbol, slowest = self.surface.stiffness, self.surface.stiffness[1]
        viscosity = np.full_like(symbol, slowest) if by_interface else np.maximum(symbol, slowest)
        damping = 0.0
        for _ in range(_MOST_STEPS):
            if here.potential < least:
                return None
            if self.control.is_load and x > 0 and here.adhesion == 0:
                return here
            worst = float(np.abs(here.residual).max())
            if worst < self.balanced:
                return here
            self.steps += 1
            share = min(_LOOSE, math.sqrt(worst / float(self.surface.strength.max())))
            way, length = self._solve(here, here.residual, share, 1.0, symbol + damping * viscosity)
            downhill = False
            if length < math.inf:
                after = self.at(np.maximum(here.gap + way / max(1.0, length), 0.0), x)
                fall = here.potential - after.potential
                if abs(fall) < self.rounding * self.h_max:  # by the forces at both ends
                    fall = -product(here.residual + after.residual, after.gap - here.gap)
                downhill = fall > 0
            if not downhill:
                damping = max(1.0, _SLOWER * damping)
                if damping < _MOST_DAMPING:
                    continue
                if worst < _STALLED * self.balanced:  # the energy is at its rounding
                    return here
                break
            here = after
            damping *= min(1.0, max(length / _AIM, _FASTER)) * (damping > _LEAST_DAMPING)
        raise PathError(
            f"the descent ends at no minimum, at a prescribed {x:g} (in m, under a load in Pa): "
            "give more nodes_per_wave, or take the method 'sharp'"
        )

    def at(self, gap: Array, x: float) -> Minimum:
        """Compute energies and forces at a gap; at a fixed separation it is stretched to that."""
        surface, control = self.surface, self.control
        if control.is_fixed:
            gap = gap * (x / gap.mean())
        lifted = gap + surface.height
        restoring = surface.filter(surface.stiffness, lifted)
        adhesion, tension, ends = surface.attract(gap)
        gradient = restoring + tension
        free: Array = np.where(gap > 0, 1.0, 0.0)
        separation = float(gap.mean())
        p = -x if control.is_load else control.stiffness * (separation - x)
        if control.is_fixed:
            p = -_mean(gradient, free)
        free[gradient + p < -self.balanced] = 1.0  # contact that is pulled off
        if control.is_fixed:
            p = -_mean(gradient, free)
        elastic = 0.5 * product(lifted, restoring) / surface.n
        potential = control.potential(elastic + adhesion, separation, p, self.h_max, 1.0)
        residual = (gradient + p) * free
        return Minimum(gap, x, separation, p, elastic, adhesion, potential, free, residual, ends)

    def rate(self, here: Minimum) -> tuple[Array, float]:
        """Compute dg/dx and dY/dx along the branch of a minimum, Y the conjugate of the control.

        To a millionth: of stiff solids the loss is a small difference of large works.
        """
        control, stiffness = self.control, self.surface.stiffness
        if control.is_fixed:
            start = here.free / here.free.mean()
            out_of_balance = self._restrict(self._stiffen(start, here, stiffness), here)
        else:
            start = np.zeros_like(here.free)
            out_of_balance = -here.free * (1.0 if control.is_load else control.stiffness)
        way, _ = self._solve(here, out_of_balance, _RATE, math.inf, stiffness)
        way += start
        if control.is_fixed:
            return way, -_mean(self._stiffen(way, here, stiffness), here.free)
        moved = float(way.mean())
        return way, moved if control.is_load else control.stiffness * (moved - 1.0)

    def _solve(
        self, here: Minimum, residual: Array, share: float, longest: float, stiffness: Array
    ) -> tuple[Array, float]:
        """Balance a residual to a share of it by a motion.

        Also returns how long the motion is, over what it may be: it ends where it is longer than
        ``longest``, and is infinite where a direction has no positive curvature.
        """
        surface = self.surface
        way, residual = np.zeros(surface.n), residual.copy()
        may_go = _LONGEST * np.maximum(here.gap - surface.range, surface.range)
        compliance = 1 / np.maximum(stiffness, surface.stiffness[1])
        enough = share * math.sqrt(product(residual, residual))
        fall = self._restrict(surface.filter(compliance, residual), here)
        direction, force = -fall, product(residual, fall)
        length = 0.0
        for _ in range(_ITERATIONS):
            change = self._restrict(self._stiffen(direction, here, stiffness), here)
            curvature = product(direction, change)
            if curvature <= 0:
                return way, math.inf
            way += (force / curvature) * direction
            residual += (force / curvature) * change
            length = float(np.abs(way / may_go).max())
            if product(residual, residual) <= enough**2 or length > longest:
                break
            fall = self._restrict(surface.filter(compliance, residual), here)
            before, force = force, product(residual, fall)
            direction = (force / before) * direction - fall
        return way, length

    def _stiffen(self, motion: Array, here: Minimum, stiffness: Array) -> Array:
        """Compute by how much a motion changes the forces at all nodes, in Pa."""
        change = self.surface.filter(stiffness, motion)
        here.ends.force_by(motion, change)
        if not (self.control.is_fixed or self.control.is_load):
            change += self.control.stiffness * motion.mean()
        return change

    def _restrict(self, values: Array, here: Minimum) -> Array:
        """Restrict to motions of free nodes, at a fixed separation to those without a mean."""
        if self.control.is_fixed:
            values = values - _mean(values, here.free)
        return values * here.free


def _mean(values: Array, free: Array) -> float:
    """Return the mean over the free nodes."""
    return product(values, free) / float(np.add.reduce(free))
