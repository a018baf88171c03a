"""A stable branch: predictor, corrector, and what ends it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.jumps import Branch
from solver.sharp.edges import CORRECTED, EdgeMechanics, Point
from solver.sharp.jump import Jumps
from solver.sharp.states import States, Trace
from solver.sharp.touch import Nucleation, Touch

_PREDICTED = 0.15  # longest predicted motion of an edge in one continuation step, in λ_min
_FASTEST_CLOSING = 4.0  # a gap closes locally at most so many times faster than the mean gap
_QUIET = 0.05  # mean stresses below this (in units of σ~ = 1) do not tighten the trapezoidal rule


@dataclass(frozen=True)
class Resolution:
    """How finely a path is followed; separations as q0 s.

    Attributes
    ----------
    jump : float
        Separation to which a jump is located.
    bend : float
        Largest relative error of the trapezoidal rule over one step.
    scale : float
        q0 h_max.
    """

    jump: float
    bend: float
    scale: float


@dataclass(frozen=True)
class Target:
    """Where a path goes: d, the same in m or Pa without rounding, and on which branch."""

    at: float
    prescribed: float
    branch: Branch


class Follower:
    """Follows the branches of one problem.

    Parameters
    ----------
    edges : EdgeMechanics
    nucleation : Nucleation
    states : States
    jumps : Jumps
    resolution : Resolution
    """

    def __init__(
        self,
        edges: EdgeMechanics,
        nucleation: Nucleation,
        states: States,
        jumps: Jumps,
        resolution: Resolution,
    ) -> None:
        self.edges, self.nucleation, self.states, self.jumps = edges, nucleation, states, jumps
        self.resolution = resolution

    def equilibrium(self, point: Point, at: float) -> Point | None:
        """Stable equilibrium at q0 s = ``at`` near the one predicted from ``point``."""
        return self.edges.equilibrium(point.predicted(at), at, CORRECTED * self.edges.wave)

    def run(self, trace: Trace, point: Point, target: Target) -> tuple[float, Point | None]:
        """Walk along a stable branch to the target or through its next jump.

        Returns
        -------
        at, point
            q0 s reached and the stable state there, None if no contact is left.
        """
        wanted = np.inf
        shown = point
        # where to look for touches next; the way since the last look
        look, trail = point.at, [point]
        while point.at != target.at:
            step = self._next_step(point, target.at, wanted)
            reached = self._advance(point, step, target.at)
            if reached is None:
                if abs(step) > self.resolution.jump:
                    wanted = max(0.25 * abs(step), 0.999 * self.resolution.jump)
                    continue
                touched = None
                if len(trail) > 1:
                    touched, _ = self.nucleation.located(trail, self.resolution.jump)
                if touched is not None:
                    return self._touch(trace, *touched, target.branch)
                at = target.at if step == target.at - point.at else point.at + step
                return at, self._fold(trace, point, at, target.branch)
            error = self._trapezoid_error(shown, reached)
            if error > 4 and abs(step) > self.resolution.jump:
                wanted = 0.5 * abs(step)
                continue
            if target.branch == "loading":
                trail.append(reached)
                if reached.at <= look or reached.at == target.at:
                    touched, clearance = self.nucleation.located(trail, self.resolution.jump)
                    if touched is not None:
                        return self._touch(trace, *touched, target.branch)
                    look, trail = reached.at - clearance / self._closing(reached), [reached]
            small = self.edges.without_small(reached.field.gaps)
            if small is not None:
                last = self.states.of_point(reached)
                trace.states.append(last)
                after = self.jumps.run(trace, last, small, reached.at, target.branch)
                return reached.at, after
            point, wanted = reached, 2 * abs(step)
            if point.at == target.at:
                exact = target.prescribed if self.states.problem.control.is_fixed else None
                trace.states.append(self.states.of_point(point, exact))
            elif error > 1:
                trace.states.append(self.states.of_point(point))
                shown = point
        return target.at, point

    def _closing(self, point: Point) -> float:
        """How fast a gap may close locally, in units of d."""
        if self.states.problem.control.is_fixed:
            return _FASTEST_CLOSING
        # d(q0 s)/dd along the branch, from d = share q0 s - give p and dY/dd
        share, give = self.edges.law.hold
        mean = 1 + give * point.slope if share else point.slope
        return _FASTEST_CLOSING * max(1.0, abs(mean))

    def _touch(
        self, trace: Trace, point: Point, touches: list[Touch], branch: Branch
    ) -> tuple[float, Point | None]:
        """Jump from the point of a branch at which surfaces touch inside a gap."""
        before = self.states.of_point(point)
        trace.states.append(before)
        gaps = point.field.gaps
        return point.at, self.jumps.run(trace, before, gaps, point.at, branch, touches)

    def _fold(self, trace: Trace, point: Point, at: float, branch: Branch) -> Point | None:
        """Jump at q0 s = ``at``, a step beyond the last point of a branch."""
        last = self.states.of_point(point)
        before = self.states.shifted(last, point.field, at)
        trace.states += [last, before]
        return self.jumps.run(trace, before, point.field.gaps, at, branch)

    def _next_step(self, point: Point, target: float, wanted: float) -> float:
        """Next step in q0 s: no edge moves too far by prediction, the target is not passed."""
        fastest = float(np.abs(point.rate).max())
        size = min(wanted, _PREDICTED * self.edges.wave / max(fastest, 1e-300))
        size = max(size, 0.999 * self.resolution.jump)
        left = target - point.at
        return left if size >= abs(left) else float(np.copysign(size, left))

    def _advance(self, point: Point, step: float, target: float) -> Point | None:
        """Predict and correct; None if no stable equilibrium is within reach."""
        if np.abs(point.rate * step).max() > 2 * _PREDICTED * self.edges.wave:
            return None
        return self.equilibrium(point, target if step == target - point.at else point.at + step)

    def _trapezoid_error(self, shown: Point, point: Point) -> float:
        """Error of the trapezoidal rule since the last state shown, in units of what is allowed."""
        span = abs(point.at - shown.at)
        # p = q0 h_max is σ~ = 1
        load = self.states.problem.control.is_load
        conjugate = point.field.separation - self.resolution.scale if load else point.field.pressure
        scale = max(abs(conjugate), _QUIET * self.resolution.scale)
        return float(span * abs(point.slope - shown.slope) / 12 / (self.resolution.bend * scale))
