"""Method ``sharp``: contact edges are real numbers; no grid in the mechanics.

The elastic field of given edges is that of :mod:`solver.sharp.field`; this module follows the edges
along the loading path. Along a stable branch it steps in the separation with a tangent predictor
and Newton's corrector; where the corrector finds no stable equilibrium within reach, the step is
cut down to the wanted resolution of a jump, and the edges then descend in energy at fixed
separation.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from solver.jumps import Jump, classify
from solver.method import Branch, ContactState, Fields, Method, Path
from solver.problem import Problem
from solver.profile import Array
from solver.sharp.edges import EdgeMechanics, Point
from solver.sharp.field import GapField
from solver.sharp.opening import work_of_gaps
from solver.sharp.output import fields_of
from solver.sharp.source import StressSource
from solver.sharp.touch import Nucleation, Touch

_PREDICTED = 0.15  # longest predicted motion of an edge in one continuation step, in λ_min
_CORRECTED = 0.05  # longest correction of a prediction, in λ_min
_FASTEST_CLOSING = 4.0  # a gap closes locally at most so many times faster than the mean gap
_RESOLUTION = 0.05  # resolution of a jump's separation, in units of accuracy·h_max
_FIELD_ACCURACY = 1e-2  # accuracy of the field in units of the accuracy of the loss
_BEND = 1.5e-4  # largest relative error of the trapezoidal rule over one step
_QUIET = 0.05  # mean stresses below this (in units of σ~ = 1) do not tighten that rule


class SharpMethod(Method):
    """Real-valued edges; see the module's text.

    Parameters
    ----------
    problem : Problem
    accuracy : float
        Wanted relative error of the loss: sets the accuracy of the field, the resolution of the
        separation of jumps and the density of the states.
    """

    name = "sharp"

    def __init__(self, problem: Problem, *, accuracy: float = 1e-3) -> None:
        super().__init__(problem)
        profile, modulus = problem.profile, problem.half_space.modulus
        self.accuracy = accuracy
        self.q0 = profile.q0
        tolerance = float(np.clip(_FIELD_ACCURACY * accuracy, 1e-14, 1e-5))
        self.source = StressSource(profile, tolerance)
        critical = 4 * np.sqrt(self.q0 * problem.work_of_adhesion / (np.pi * modulus))
        self.edges = EdgeMechanics(self.source, critical, tolerance)
        self.nucleation = Nucleation(problem, self.edges)
        self.h_max = profile.h_max * self.q0
        self.resolution = _RESOLUTION * accuracy * self.h_max
        self._bend = _BEND * np.sqrt(min(1.0, accuracy / 1e-3))
        self._loaded: list[ContactState] = []  # without adhesion: the way back
        m = np.arange(profile.coefficients.size)
        h = np.abs(profile.coefficients * self.q0) ** 2
        self._full_energy = float(2 * np.pi * np.sum(m * h))  # ½∫S_full h~, both signs of m

    def describe(self) -> dict[str, Any]:
        """Accuracy, tolerances and counters."""
        return {
            "accuracy": self.accuracy,
            "field_tolerance": self.edges.tolerance,
            "jump_resolution": self.resolution / self.h_max,
            **asdict(self.edges.count),
        }

    def fields(self, state: ContactState, n: int) -> Fields:
        """Stress, displacement and gap of ``state`` on n nodes, by quadrature over the gaps."""
        field = None
        if state.patches:
            field = self.edges.field(state.internal, state.separation * self.q0)
        return fields_of(self.problem, field, state.separation, n)

    def follow(self, state: ContactState, separation: float) -> Path:
        """Follow the quasi-static path; see the contract."""
        branch: Branch = "loading" if separation <= state.separation else "unloading"
        if self.problem.work_of_adhesion == 0:
            return self._follow_reversibly(state, separation)
        events = list(self._events(state, separation, branch))
        return Path(
            tuple(e for e in events if isinstance(e, ContactState)),
            tuple(e for e in events if isinstance(e, Jump)),
        )

    def _follow_reversibly(self, state: ContactState, separation: float) -> Path:
        """Without adhesion the state at a separation is unique, and nothing jumps.

        On loading patches appear, grow and merge smoothly. Unloading goes back through the states
        of loading; a state that is missing is loaded to from a lighter one.
        """
        if separation <= state.separation:
            events = list(self._events(state, separation, "loading"))
            states = [e for e in events if isinstance(e, ContactState)]
            self._loaded += states
            return Path(tuple(states), ())
        lighter = [s for s in self._loaded if s.separation >= separation]
        back = [s for s in self._loaded if state.separation < s.separation < separation]
        first = self.detached(max(separation, self.problem.profile.h_max))
        start = min(lighter, key=lambda s: s.separation, default=first)
        if start.separation > separation:
            found = self._events(start, separation, "loading")
            start = [e for e in found if isinstance(e, ContactState)][-1]
        back.reverse()  # states at one separation come in the order opposite to loading
        return Path((*sorted(back, key=lambda s: s.separation), start), ())

    # ------------------------------------------------------------------ states

    def _state(
        self,
        field: GapField | None,
        at: float,
        slope: float = float("nan"),
        separation: float | None = None,
    ) -> ContactState:
        """Contact state of a field (None: no contact) at q0 s = ``at``, dp/d(q0 s) = ``slope``."""
        separation = at / self.q0 if separation is None else separation
        if field is None:
            return self.detached(separation)
        self.edges.count.energies += 1
        half = self.problem.half_space.modulus / 2
        gaps = field.gaps
        left = np.append(gaps[-1, 1] - 2 * np.pi, gaps[:-1, 1])  # of the patch before each gap
        right = gaps[:, 0]
        measure = self.source.measure_between(left, right)
        turn = np.floor(left / (2 * np.pi)) * 2 * np.pi
        patches = np.stack([left - turn, right - turn], axis=1) / self.q0
        elastic = self._full_energy + 0.5 * work_of_gaps(field) - np.pi * at * field.pressure
        return ContactState(
            separation=separation,
            edges=patches[np.argsort(patches[:, 0])],
            mean_stress=field.pressure * half,
            elastic_energy=elastic * half / self.q0**2,
            adhesion_energy=-self.problem.work_of_adhesion * measure / self.q0,
            contact_fraction=float((right - left).sum() / (2 * np.pi)),
            stiffness=slope * half * self.q0,
            internal=gaps,
        )

    def _shifted(self, state: ContactState, field: GapField, at: float) -> ContactState:
        """State at q0 s = ``at`` with the edges of ``state``: p is linear in s, U quadratic."""
        half = self.problem.half_space.modulus / 2
        way = at - field.separation
        pressure = field.pressure + field.pressure_by_separation * way
        work = -np.pi * way * (field.pressure + pressure)
        return replace(
            state,
            separation=at / self.q0,
            mean_stress=pressure * half,
            elastic_energy=state.elastic_energy + work * half / self.q0**2,
            stiffness=float("nan"),
        )

    # ------------------------------------------------------------------ following

    def _events(
        self, state: ContactState, separation: float, branch: Branch
    ) -> Generator[ContactState | Jump, None, None]:
        at, target = state.separation * self.q0, separation * self.q0
        gaps: Array = state.internal if state.patches else np.empty((0, 2))
        if not len(gaps):
            first, highest = self.nucleation.first_touch()
            if branch == "unloading" or target > first:
                yield self.detached(separation)
                return
            at = first
            yield self.detached(at / self.q0)
            point = yield from self._jump(gaps, at, branch, touches=highest)
        else:
            point = self._equilibrium(gaps, at)
            if point is None:
                point = yield from self._jump(gaps, at, branch)
            elif at == target:
                yield self._state(point.field, at, point.slope, separation)
        while point is not None and at != target:
            at, point = yield from self._branch(point, target, separation, branch)
        if point is None and at != target:
            yield self.detached(separation)

    def _branch(
        self, point: Point, target: float, separation: float, branch: Branch
    ) -> Generator[ContactState | Jump, None, tuple[float, Point | None]]:
        """Walk along a stable branch to the target or through its next jump."""
        wanted = np.inf
        slope = point.slope
        shown = (point.at, slope)
        # where to look for touches next; the way since the last look
        look, trail = point.at, [point]
        while point.at != target:
            step = self._next_step(point, target, wanted)
            reached = self._advance(point, step, target)
            if reached is None:
                if abs(step) > self.resolution:
                    wanted = max(0.25 * abs(step), 0.999 * self.resolution)
                    continue
                touched = self._touched(trail)[0] if len(trail) > 1 else None
                if touched is not None:
                    return (yield from self._touch(*touched, branch))
                last = self._state(point.field, point.at, slope)
                yield last
                at = target if step == target - point.at else point.at + step
                after = yield from self._jump(
                    point.field.gaps, at, branch, self._shifted(last, point.field, at)
                )
                return at, after
            next_slope = reached.slope
            error = self._trapezoid_error(shown, reached, next_slope)
            if error > 4 and abs(step) > self.resolution:
                wanted = 0.5 * abs(step)
                continue
            if branch == "loading":
                trail.append(reached)
                if reached.at <= look or reached.at == target:
                    touched, clearance = self._touched(trail)
                    if touched is not None:
                        return (yield from self._touch(*touched, branch))
                    look, trail = reached.at - clearance / _FASTEST_CLOSING, [reached]
            small = self.edges.without_small(reached.field.gaps)
            if small is not None:
                last = self._state(reached.field, reached.at, next_slope)
                after = yield from self._jump(
                    reached.field.gaps, reached.at, branch, last, start=small
                )
                return reached.at, after
            point, slope, wanted = reached, next_slope, 2 * abs(step)
            if point.at == target:
                yield self._state(point.field, target, slope, separation)
            elif error > 1:
                yield self._state(point.field, point.at, slope)
                shown = (point.at, slope)
        return target, point

    def _touch(
        self, point: Point, touches: list[Touch], branch: Branch
    ) -> Generator[ContactState | Jump, None, tuple[float, Point | None]]:
        """Jump from the point of a branch at which surfaces touch inside a gap."""
        before = self._state(point.field, point.at, point.slope)
        after = yield from self._jump(point.field.gaps, point.at, branch, before, touches=touches)
        return point.at, after

    def _next_step(self, point: Point, target: float, wanted: float) -> float:
        """Next step in q0 s: no edge moves too far by prediction, the target is not passed."""
        fastest = float(np.abs(point.rate).max())
        size = min(wanted, _PREDICTED * self.edges.wave / max(fastest, 1e-300))
        size = max(size, 0.999 * self.resolution)
        left = target - point.at
        return left if size >= abs(left) else float(np.copysign(size, left))

    def _advance(self, point: Point, step: float, target: float) -> Point | None:
        """Predict and correct; None if no stable equilibrium is within reach."""
        if np.abs(point.rate * step).max() > 2 * _PREDICTED * self.edges.wave:
            return None
        at = target if step == target - point.at else point.at + step
        return self._equilibrium(point.predicted(at), at)

    def _equilibrium(self, gaps: Array, at: float) -> Point | None:
        return self.edges.equilibrium(gaps, at, _CORRECTED * self.edges.wave)

    def _trapezoid_error(self, shown: tuple[float, float], point: Point, slope: float) -> float:
        """Error of the trapezoidal rule since the last state shown, in units of what is allowed."""
        span = abs(point.at - shown[0])
        scale = max(abs(point.field.pressure), _QUIET * self.h_max)  # p = h_max is σ~ = 1
        return float(span * abs(slope - shown[1]) / 12 / (self._bend * scale))

    # ------------------------------------------------------------------ jumps

    def _jump(
        self,
        gaps: Array,
        at: float,
        branch: Branch,
        before: ContactState | None = None,
        start: Array | None = None,
        touches: list[Touch] | None = None,
    ) -> Generator[ContactState | Jump, None, Point | None]:
        """Descend at fixed separation from ``gaps`` (or ``start``): before, jump, after.

        Returns the minimum as it was found: next to a fold it may not be found again from its own
        edges.
        """
        if before is None:
            before = self._state(self.edges.field(gaps, at) if len(gaps) else None, at)
        if len(gaps):
            yield before
        point = self._relax(gaps if start is None else start, at, touches or [])
        while branch == "loading" and point is not None:
            ready = self._ready(self.nucleation.minima(point.field))
            grown = self._relax(point.field.gaps, at, ready) if ready else None
            if grown is None or self._same(grown.field.gaps, point.field.gaps):
                break
            point = grown
        after = self.detached(at / self.q0)
        if point is not None:
            after = self._state(point.field, at, point.slope)
        period = self.problem.profile.period
        drop = (before.energy - after.energy) / period
        kind, length = classify(before.edges, after.edges, period)
        yield Jump(
            branch=branch,
            separation=at / self.q0,
            energy_drop=drop,
            kind=kind,
            patches_before=before.patches,
            patches_after=after.patches,
            contact_before=before.contact_fraction,
            contact_after=after.contact_fraction,
            patch_length=length,
        )
        yield after
        return point

    def _same(self, one: Array, other: Array) -> bool:
        """Whether two equilibria are one to the accuracy at which they are known."""
        return one.shape == other.shape and bool(np.abs(one - other).max() < 10 * self.edges.coarse)

    def _relax(self, gaps: Array, at: float, touches: list[Touch]) -> Point | None:
        """Descend to the next minimum of the energy; None when no contact is left."""
        if touches:
            gaps = self.nucleation.seeded(gaps, touches)
        while len(gaps):
            found = self.edges.relax(gaps, at, _CORRECTED * self.edges.wave)
            if isinstance(found, Point):
                return found
            gaps = found
        return None

    # ------------------------------------------------------------------ touching

    def _ready(self, minima: list[Touch]) -> list[Touch]:
        return [t for t in minima if self.nucleation.clearance(t) <= 0]

    def _touched(self, trail: list[Point]) -> tuple[tuple[Point, list[Touch]] | None, float]:
        """First point of the trail at which surfaces touch inside a gap, with the touches.

        Else None and the least clearance at the end of the trail. The trail starts at a point known
        to be clear.
        """
        minima = self.nucleation.minima(trail[-1].field)
        least = min((self.nucleation.clearance(t) for t in minima), default=np.inf)
        if least > 0:
            return None, least
        clear_value = np.nan
        hit, hit_minima, hit_value = trail[-1], minima, least
        # over the points of the trail, then within one step of it
        low, high = 0, len(trail) - 1
        while high - low > 1:
            middle = (low + high) // 2
            minima = self.nucleation.minima(trail[middle].field)
            value = min((self.nucleation.clearance(t) for t in minima), default=np.inf)
            if value > 0:
                low, clear_value = middle, value
            else:
                high, hit, hit_minima, hit_value = middle, trail[middle], minima, value
        clear = trail[low].at
        while clear - hit.at > self.resolution and hit_value < 0:
            share = 0.5
            if np.isfinite(clear_value):
                # secant, kept off the ends
                share = min(max(clear_value / (clear_value - hit_value), 0.02), 0.98)
            aim = clear + (hit.at - clear) * share
            point = self._equilibrium(hit.predicted(aim), aim)
            if point is None:
                break
            minima = self.nucleation.minima(point.field)
            value = min((self.nucleation.clearance(t) for t in minima), default=np.inf)
            if value > 0:
                clear, clear_value = aim, value
            else:
                hit, hit_minima, hit_value = point, minima, value
        return (hit, self._ready(hit_minima)), 0.0
