"""Descent of a gap to the next minimum of its energy, at a prescribed separation or load.

Newton's method with conjugate gradients, preconditioned by the compliance, on the nodes that are
not in contact. Contact nodes are those with g = 0 that are pressed; one that is pulled by more than
the strength opens, so that contact, zones and openings need no rule of their own. Where the
curvature along a direction is not positive the state is no minimum, and the descent goes on along
it. No step moves a node by more than half the range, or half of what it is beyond the range: the
end of a zone does not leap over a minimum.

With a stiffness k of what holds the solid the mean gap s is free, and ½k(s - x)² is added to U;
under a load p̄ it is p̄ s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
_STALLED = 1e3  # times that: residual where the energy falls no more
_MOST_STEPS = 20_000
_SHORTEST = 1e-6  # share to which a step is shortened that does not lower the energy


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
    """

    gap: Array
    prescribed: float
    separation: float
    mean_stress: float
    elastic: float
    adhesion: float
    potential: float


@dataclass(frozen=True, eq=False)
class _Forces:
    """Forces at a gap.

    Attributes
    ----------
    residual : array, shape (n,)
        What is out of balance at free nodes, in Pa.
    free : array of bool, shape (n,)
    longest : array, shape (n,)
        Longest way of each node in one step, in m.
    ends : ZoneEnds
    """

    residual: Array
    free: NDArray[np.bool_]
    longest: Array
    ends: ZoneEnds

    def reach(self, way: Array) -> float:
        """Return the largest way of a node, over the longest that it may go."""
        return float(np.abs(way / self.longest).max())


class Descent:
    """Minimisation of the energy of one surface under one control; counts its steps."""

    def __init__(self, surface: Surface, control: Control, h_max: float) -> None:
        self.surface, self.control, self.h_max = surface, control, h_max
        self.steps = 0
        rounding = _ROUNDING * np.finfo(float).eps * h_max * float(surface.stiffness[-1])
        self.balanced = max(_BALANCED * float(surface.strength.min()), rounding)

    def run(
        self, gap: Array, x: float, falls: Callable[[Minimum], bool] | None = None
    ) -> Minimum | None:
        """Descend from a gap to the minimum at the prescribed value ``x``.

        None if ``falls`` is true of a gap on the way. Under a tension that nothing carries the gap
        is returned at which the solid falls off.

        Raises
        ------
        PathError
            If there is no minimum within the largest number of steps, or the energy falls no more.
        """
        here, forces = self._at(self._prescribe(np.maximum(gap, 0.0), x), x)
        for _ in range(_MOST_STEPS):
            if falls is not None and falls(here):
                return None
            if self.control.is_load and x > 0 and here.adhesion == 0:
                return here
            if float(np.abs(forces.residual).max()) < self.balanced:
                return here
            self.steps += 1
            way = self._correction(forces)
            share = 1.0
            while True:
                later = self._prescribe(np.maximum(here.gap + share * way, 0.0), x)
                after, forces_after = self._at(later, x)
                if after.potential <= here.potential or share < _SHORTEST:
                    break
                share *= 0.5
            if share < _SHORTEST:  # the energy is at its rounding
                if float(np.abs(forces.residual).max()) < _STALLED * self.balanced:
                    return here
                break
            here, forces = after, forces_after
        raise PathError(
            f"the descent ends at no minimum, at a prescribed {x:g} (in m, under a load in Pa): "
            "give more nodes_per_wave, or take the method 'sharp'"
        )

    def _prescribe(self, gap: Array, x: float) -> Array:
        """Give a gap the prescribed mean, by stretching it."""
        return gap * (x / gap.mean()) if self.control.is_fixed else gap

    def _at(self, gap: Array, x: float) -> tuple[Minimum, _Forces]:
        """Compute energies and forces at a gap."""
        surface, control = self.surface, self.control
        lifted = gap + surface.height
        restoring = surface.filter(surface.stiffness, lifted)
        adhesion, tension, ends = surface.attract(gap)
        gradient = restoring + tension
        free = gap > 0
        separation = float(gap.mean())
        if not control.is_fixed:
            held = control.stiffness * (separation - x)
            p = -x if control.is_load else held
            free |= gradient + p < -self.balanced
        else:
            p = -float(gradient[free].mean())
            free |= gradient + p < -self.balanced  # contact that is pulled off
            p = -float(gradient[free].mean())
        elastic = 0.5 * product(lifted, restoring) / surface.n
        potential = control.potential(elastic + adhesion, separation, p, self.h_max, 1.0)
        here = Minimum(gap, x, separation, p, elastic, adhesion, potential)
        longest = _LONGEST * np.maximum(gap - surface.range, surface.range)
        return here, _Forces(np.where(free, gradient + p, 0.0), free, longest, ends)

    def rate(self, here: Minimum) -> tuple[Array, float]:
        """Compute dg/dx and dY/dx along the branch of a minimum, Y the conjugate of the control.

        To a millionth: of stiff solids the loss is a small difference of large works.
        """
        control = self.control
        _, forces = self._at(here.gap, here.prescribed)
        uniform = forces.free.astype(float)
        if control.is_fixed:
            start = uniform / uniform.mean()
            out_of_balance = self._restrict(self._stiffen(start, forces), forces)
        else:
            start = np.zeros(self.surface.n)
            out_of_balance = -uniform * (1.0 if control.is_load else control.stiffness)
        way, _ = self._solve(out_of_balance, start, forces, _RATE, math.inf)
        if control.is_fixed:
            return way, -float(self._stiffen(way, forces)[forces.free].mean())
        moved = float(way.mean())
        return way, moved if control.is_load else control.stiffness * (moved - 1.0)

    def _correction(self, forces: _Forces) -> Array:
        """Solve for the motion that balances the forces, or that leads downhill."""
        worst = float(np.abs(forces.residual).max()) / float(self.surface.strength.max())
        start = np.zeros(self.surface.n)
        share = min(_LOOSE, float(np.sqrt(worst)))
        way, downhill = self._solve(forces.residual, start, forces, share, 4.0)
        if downhill is not None:
            way += downhill / forces.reach(downhill)
        return way / max(1.0, forces.reach(way))

    def _solve(
        self, residual: Array, start: Array, forces: _Forces, share: float, longest: float
    ) -> tuple[Array, Array | None]:
        """Balance a residual to a share of it, by a motion from ``start`` on.

        Also returns a direction of no positive curvature, if there is one on the way. The motion
        ends where it is ``longest`` times as long as it may be.
        """
        surface = self.surface
        way, residual = start.copy(), residual.copy()
        enough = share * math.sqrt(product(residual, residual))
        fall = self._restrict(surface.filter(surface.compliance, residual), forces)
        direction, force = -fall, product(residual, fall)
        for _ in range(_ITERATIONS):
            change = self._restrict(self._stiffen(direction, forces), forces)
            curvature = product(direction, change)
            if curvature <= 0:
                return way, direction
            way += (force / curvature) * direction
            residual += (force / curvature) * change
            if product(residual, residual) <= enough**2 or forces.reach(way) > longest:
                break
            fall = self._restrict(surface.filter(surface.compliance, residual), forces)
            before, force = force, product(residual, fall)
            direction = (force / before) * direction - fall
        return way, None

    def _stiffen(self, motion: Array, forces: _Forces) -> Array:
        """Compute by how much a motion changes the forces at all nodes, in Pa."""
        change = self.surface.filter(self.surface.stiffness, motion)
        forces.ends.force_by(motion, change)
        if not (self.control.is_fixed or self.control.is_load):
            change += self.control.stiffness * motion.mean()
        return change

    def _restrict(self, values: Array, forces: _Forces) -> Array:
        """Restrict to motions of free nodes, at a fixed separation to those without a mean."""
        free = forces.free
        if self.control.is_fixed:
            values = values - values[free].mean()
        return np.asarray(np.where(free, values, 0.0), dtype=np.float64)
