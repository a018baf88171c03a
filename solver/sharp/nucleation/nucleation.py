"""Where the surfaces touch inside a gap, and the patch that is put there.

Contact nucleates only where the opening has closed to zero. With adhesion a touching point grows at
once, along a path on which the energy only falls, to its first equilibrium; on the parabola κx²/2
that is (16 Γ/(π κ²))^(1/3) wide, Γ = 2γ q0/E* (lengths in 1/q0). A seed of half that width is put
at the touching point; the descent does the rest. Without adhesion a patch has no width at first
touch: it is put when the overlap is large enough for the narrowest patch that is followed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import EQUAL_CRESTS, Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.errors import NoState
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.field.solution import Nodes
from adhesis.solver.sharp.gap.ends import with_patches
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, GaussRules, Integers
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.nucleation.clearance import NOT_SEEN, Seen, clearance_left, noted
from adhesis.solver.sharp.nucleation.closing import Closing
from adhesis.solver.sharp.nucleation.gap_minima import bottoms_of
from adhesis.solver.sharp.nucleation.location import Located
from adhesis.solver.sharp.tolerances import CLEAR_TRIALS, COMPARABLE, OVERLAP, TOUCH_TRIALS


@dataclass(frozen=True)
class Touch:
    """Local minimum of an opening: place, value and curvature κ, in units of 1/q0."""

    theta: float
    opening: float
    curvature: float


class Minima(NamedTuple):
    """Local minima of the openings of some gaps: place, value and curvature, shape (minima,)."""

    theta: Array
    opening: Array
    curvature: Array


class Lengths(NamedTuple):
    """Constants of a problem that a search for touches takes.

    Attributes
    ----------
    near, beside : float
        See ``clearance.clearance_left``.
    surface, narrowest, widest : float
        See :func:`seed_width`.
    top : int
        Highest harmonic of the profile.
    """

    near: float
    beside: float
    surface: float
    narrowest: float
    widest: float
    top: int


class TrackedGaps(NamedTuple):
    """Gaps that close on a stretch of a branch: their clearances, and how these are computed."""

    closing: Closing
    values: Callable[[GapField], Array]


@compiled_for_both
def seed_width(curvature: float, lengths: Lengths) -> float:
    """Width of the patch that is put where surfaces with the energy Γ touch with this curvature."""
    first = (16 * lengths.surface / (np.pi * curvature**2)) ** (1 / 3)
    width: float = min(max(0.5 * first, lengths.narrowest), lengths.widest)
    return width


@compiled_for_both
def clearances(opening: Array, curvature: Array, lengths: Lengths) -> Array:
    """As :meth:`Nucleation.clearance`."""
    out = np.empty(opening.shape[0])
    for i in range(opening.shape[0]):
        width = seed_width(curvature[i], lengths)
        out[i] = opening[i]
        # Overlap of a narrow patch of width w: κw²/8 times a logarithm of the distance over which
        # the surface follows it, 10 to 20 here.
        if width <= lengths.narrowest:
            out[i] += 4 * curvature[i] * width**2
    return out


@compiled_for_both
def look_at(
    gaps: Integers, nodes: Nodes, f: Array, rules: GaussRules, panels: Panels, lengths: Lengths,
    out: Array,
) -> Minima:  # fmt: skip
    """Find the minima of some gaps; ``out`` receives their least clearances, at their places."""
    theta, opening, curvature, where = bottoms_of(gaps, nodes, f, rules, lengths.top, panels)
    values = clearances(opening, curvature, lengths)
    for k in gaps:
        out[k] = np.inf
    for i in range(where.shape[0]):
        out[where[i]] = min(out[where[i]], values[i])
    return Minima(theta, opening, curvature)


@compiled
def search(
    gaps: Array, nodes: Nodes, f: Array, rules: GaussRules, panels: Panels, lengths: Lengths,
    seen: Seen,
) -> tuple[float, int, Minima, Seen]:  # fmt: skip
    """Find the least clearance of a field, looking only at gaps that may be used up.

    Also returns the number of these gaps, their minima, and what has been seen now.
    """
    left, place, fresh, is_same = clearance_left(
        gaps, nodes, f, rules, seen, lengths.near, lengths.beside
    )
    minima = Minima(np.empty(0), np.empty(0), np.empty(0))
    if fresh.shape[0] > 0:
        minima = look_at(fresh, nodes, f, rules, panels, lengths, left)
    if not is_same:
        seen = noted(gaps, nodes, f, rules, seen, place, left)
    return left.min(), fresh.shape[0], minima, seen


class Nucleation:
    """Finds touching points and puts seeds there: a criterion of ``location.locate``.

    Attributes
    ----------
    seen : Seen
        Gaps as they were when they were looked at; set by whoever goes on from another state.
    """

    def __init__(self, problem: Problem, edges: EdgeMechanics) -> None:
        self.problem, self.edges = problem, edges
        self.seen = NOT_SEEN
        self._lengths = Lengths(
            near=COMPARABLE * edges.wave,
            beside=float(edges.critical / np.sqrt(edges.wave)),
            surface=math.pi * edges.critical**2 / 8,  # Γ
            narrowest=float(3 * edges.smallest),
            widest=float(edges.longest_step),
            top=edges.source.top,
        )
        self.equal = EQUAL_CRESTS * problem.profile.h_max * problem.profile.q0
        self.overlap = OVERLAP * problem.profile.h_max * problem.profile.q0

    def first_touch(self) -> tuple[float, list[Touch]]:
        """Separation q0 s at which the first patches are put, and where.

        That is at every crest as high as the highest.
        """
        profile = self.problem.profile
        crests = profile.crests()
        curvature = crests.curvature / profile.q0
        theta = crests.position * profile.q0
        highest = [Touch(float(a), 0.0, float(c)) for a, c in zip(theta, curvature, strict=True)]
        overlap = float(self.clearance(np.zeros_like(curvature), curvature).max())
        return profile.h_max * profile.q0 - overlap, highest

    def clearance(self, opening: Array, curvature: Array) -> Array:
        """Opening left at minima before a patch is put there; not positive when it is time."""
        return clearances(opening, curvature, self._lengths)

    def ready(self, minima: Minima) -> list[Touch]:
        """Where to put patches: the place of largest overlap, and those that equal it."""
        over = self.clearance(minima.opening, minima.curvature)
        least = float(over.min(initial=np.inf))
        if least > 0:
            return []
        # without adhesion patches come and go smoothly, in any order
        equal = self.equal if self.edges.critical > 0 else np.inf
        return [
            Touch(float(minima.theta[i]), float(minima.opening[i]), float(minima.curvature[i]))
            for i in np.flatnonzero(over <= min(least + equal, 0.0))
        ]

    def least(self, field: GapField) -> tuple[float, Minima]:
        """Least clearance of a field, and the minima of the gaps that may be used up.

        Only those are looked at; see ``clearance``.
        """
        of = field.solution
        least, looked_at, minima, self.seen = search(
            field.gaps, of.nodes, of.scaled_opening, GAUSS_RULES, field.source.panels,
            self._lengths, self.seen,
        )  # fmt: skip
        self.edges.count.openings += looked_at
        return least, minima

    @property
    def tolerance(self) -> float:
        """Overlap that is allowed."""
        return self.overlap

    def is_located(self, value: float, many: bool, near: bool) -> bool:
        """Whether a touch with this clearance is exact enough; see ``location.Criterion``."""
        return value == 0 or ((many or near) and value > -0.5 * self.overlap)

    def check_located(self, value: float, at: float) -> None:
        """Raise if surfaces overlap at the touch that was found."""
        if value < -self.overlap and self.edges.critical > 0:
            raise NoState("surfaces overlap, and no first touch is found", at)

    def _clearance_of(self, field: GapField, gaps: Integers) -> Array:
        """Clearance of each of some gaps."""
        self.edges.count.openings += len(gaps)
        of, out = field.solution, np.empty(len(field.gaps))
        look_at(
            gaps, of.nodes, of.scaled_opening, GAUSS_RULES, field.source.panels, self._lengths, out
        )
        return out[gaps]

    def tracked(self, clear: Point, hit: Point) -> TrackedGaps | None:
        """Track the gaps that are open at one point and overlap at another."""
        of, lengths = hit.field.solution, self._lengths
        left = clearance_left(
            hit.gaps, of.nodes, of.scaled_opening, GAUSS_RULES, self.seen, lengths.near,
            lengths.beside,
        )  # fmt: skip
        closed = np.flatnonzero(left.clearance <= 0)
        after = self._clearance_of(hit.field, closed)
        closed, after = closed[after < 0], after[after < 0]
        if len(closed) == 0 or clear.gaps.shape != hit.gaps.shape:
            return None
        before = self._clearance_of(clear.field, closed)
        closing = Closing(clear.at, hit.at, before, after)
        return TrackedGaps(closing, lambda field: self._clearance_of(field, closed))

    def located_held(self, point: Point, clearance: float, end: float) -> Located[Touch] | None:
        """Where surfaces touch between a point with this clearance and ``end``, edges held."""
        clear, low, hit = point.at, clearance, end
        cleared = 0
        field = self.edges.field(point.gaps, hit)
        high, minima = self.least(field)
        if high > -self.overlap:
            return None
        for _ in range(TOUCH_TRIALS):
            if high >= -0.5 * self.overlap:
                break
            # Openings are linear in d: a secant to a fourth of the overlap that is allowed
            share = min(max((low + 0.25 * self.overlap) / (low - high), 0.02), 0.98)
            aim = clear + (hit - clear) * (share if cleared < CLEAR_TRIALS else 0.5)
            aimed = self.edges.field(point.gaps, aim)
            value, there = self.least(aimed)
            cleared = cleared + 1 if value > 0 else 0
            if value > 0:
                clear, low = aim, value
            else:
                hit, high, field, minima = aim, value, aimed, there
        held = Point(hit, field, point.rate, float("nan"))
        return Located(held, self.ready(minima), abs(end - point.at))

    def seeded(self, gaps: Array, touches: list[Touch]) -> Array:
        """Edges with a seed at each touch."""
        return with_patches(
            gaps,
            np.array([t.theta for t in touches]),
            np.array([seed_width(t.curvature, self._lengths) for t in touches]),
        )
