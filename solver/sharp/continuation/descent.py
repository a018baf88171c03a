"""Descents in energy at a prescribed value, to the next minimum of the edges.

The kernel lets the edges of some gaps run until they come to rest or a gap or patch vanishes
(``kernels/descent.hpp``); here is decided what a rest was, a minimum or a saddle, what follows it,
and whether the minimum that was reached depends on the speeds of the edges.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.linalg import norm

from adhesis.solver._kernels import CLOSING_SHARE, DescentEvent, EdgeLaw
from adhesis.solver.method import PathError
from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.threads import one_thread
from adhesis.solver.sharp.gap.ends import (
    lengths_of,
    move_edges,
    positions,
    step_limits,
    without_small,
)
from adhesis.solver.sharp.mechanics import EdgeMechanics, Point
from adhesis.solver.sharp.output.contact_states import States
from adhesis.solver.sharp.tolerances import (
    ENDLESS,
    EQUAL,
    FIELD_ACCURACY,
    FINER_STEPS,
    OTHER_MINIMUM,
    RESTS,
)


class FullContact(Exception):
    """Error raised when the last gap of the period closes: no state with a gap is left."""


class NoState(PathError):
    """Error raised when the path has no state at ``d``; the text is the reason."""

    def __init__(self, reason: str, d: float) -> None:
        super().__init__(reason)
        self.d = d


Rival = Point | None | FullContact | NoState
"""Another end of a descent: a minimum, no contact, full contact (with a stiffness), or unknown."""


class Descents:
    """Descents of the edges of one problem.

    Attributes
    ----------
    may_race : bool
        Whether the order in which edges run may decide anything.
    """

    def __init__(self, edges: EdgeMechanics, states: States) -> None:
        self._edges, self._states = edges, states
        # Under a load edges help each other.
        self.may_race = edges.critical > 0 and not edges.is_load

    def to_minimum(self, gaps: Array, d: float, rivals: list[Rival]) -> Point | None:
        """Descend to the next minimum of the energy; None when no contact is left.

        Where edges may have raced, finer steps decide, if they end with less energy: more may be
        that of a minimum on the way that the field's error shows. Another end to which equal speeds
        or steps of the other length lead is added to ``rivals``, unless there is one; or where
        edges passed what a finer field may show to be a minimum.
        """
        others: list[Rival] = []
        passed: list[Rival] = []
        point, raced = self.relax(gaps, d, passed=passed)
        if raced and self.may_race:
            for way in ({"equal_speeds": True}, {"share": FINER_STEPS}):
                try:
                    others.append(self.relax(gaps, d, **way)[0])
                except (FullContact, NoState) as unknown:
                    others.append(unknown)
            finer = others[-1]
            if point and isinstance(finer, Point) and not self.is_same_minimum(point, finer):
                end, other = (self._states.of_point(one).potential for one in (finer, point))
                if end < other:
                    point, others[-1] = finer, point
        for rival in others + passed:
            if not rivals and self._is_rival(rival, gaps, point):
                rivals.append(rival)
        return point

    def _is_rival(self, other: Rival, start: Array, point: Point | None) -> bool:
        """Whether a descent from some gaps ended elsewhere than at a minimum."""
        if isinstance(other, Exception):
            return True
        # next to a fold the field's error may show a minimum where the edges are
        if other is not None and self.is_same(other.gaps, start):
            return False
        return not self.is_same_minimum(other, point)

    def is_same_minimum(self, one: Point | None, other: Point | None) -> bool:
        """Whether two descents led to one minimum."""
        if one is None or other is None:
            return one is other
        return self.is_same(one.gaps, other.gaps)

    def is_same(self, here: Array, there: Array) -> bool:
        """Whether gaps are those of one minimum."""
        apart = max(OTHER_MINIMUM * self._edges.wave, 10 * self._edges.field_error)
        return here.shape == there.shape and bool(np.abs(here - there).max() < apart)

    def relax(
        self,
        gaps: Array,
        prescribed: float,
        *,
        equal_speeds: bool = False,
        share: float = 1.0,
        passed: list[Rival] | None = None,
    ) -> tuple[Point | None, bool]:
        """Descend in energy at a prescribed value to the next minimum; None if no contact is left.

        By linear kinetics, or with ``equal_speeds``, to be compared with that; in steps of at most
        this share of the longest. Gaps and patches that close or vanish on the way are left out.
        Returns also whether the order in which edges ran may have decided the end. Appends to
        ``passed`` what a finer field may show to be a minimum on the way.

        Raises
        ------
        PathError
            If the descent does not end, or comes to edges that have no field.
        FullContact
            If the last gap closes, as it may where the separation is not fixed.
        """
        raced = False
        while len(gaps):
            found, by_order = self._relax_until_one_vanishes(
                gaps, prescribed, equal_speeds, share, passed
            )
            raced = raced or by_order
            if isinstance(found, Point):
                return found, raced
            gaps = found
        return None, raced

    def _relax_until_one_vanishes(
        self,
        gaps: Array,
        prescribed: float,
        equal_speeds: bool,
        share: float,
        passed: list[Rival] | None,
    ) -> tuple[Point | Array, bool]:
        """Descend to the next minimum, or until a gap or patch vanishes: the gaps without it."""
        edges = self._edges
        law = EdgeLaw(edges.law_at(gaps))
        law.longest_step *= share
        rests, raced = 0, False
        rested, start = np.empty((0, 2)), gaps
        while rests <= 2 * RESTS:
            near = edges.response_near(gaps, prescribed)
            if near is None:
                raise NoState("there is no field of these edges", prescribed)
            end = near.descend(gaps, start, prescribed, ENDLESS, equal_speeds, law, edges.model)
            edges.count.descent_steps += end.steps
            edges.count.fields += end.steps
            if end.event == DescentEvent.NO_FIELD:
                edges.forget()
                raise NoState("there is no field of these edges", prescribed)
            gaps, raced = end.gaps, raced or end.raced
            if passed is not None and len(end.passed):
                passed += self._hidden_minimum(end.passed, prescribed, law)
            if end.event == DescentEvent.VANISHED:
                rest = without_small(gaps, edges.smallest)
                if rest is not None:
                    return rest, raced
                law = EdgeLaw(law)
                law.smallest = self._smallest_of_last_gap(gaps, law.smallest)
            if end.event == DescentEvent.AT_REST:
                # Next to a fold the field's error may hide whether there is a minimum: edges go to
                # and fro. Whatever is taken for it, the next step in s decides.
                rests += 1
                same = gaps.shape == rested.shape
                if same and np.abs(gaps - rested).max() < edges.newton_tolerance:
                    rests = max(rests, RESTS + 1)  # no patience changes anything
                rested = gaps
                strict = rests <= RESTS
                point = edges.equilibrium(
                    gaps, prescribed, edges.longest_step, strict=strict, memory=law.memory
                )
                if point is not None:
                    return point, raced
                if not strict and edges.adhesion.pins:
                    edges.forget()  # that of the edges on the way may pin and release some by turns
                ways = self.ways_off_saddle(gaps, prescribed, law)
                if ways:  # by ever less where the last steps have led to and fro
                    gaps = gaps + 0.5 ** max(rests - RESTS, 0) * (ways[0] - gaps)
                elif not strict and rests <= 2 * RESTS:
                    gaps = self._move_unbalanced(gaps, prescribed, rests - RESTS, law)
        raise NoState("edges that descend in energy do not come to rest", prescribed)

    def _hidden_minimum(self, gaps: Array, prescribed: float, law: EdgeLaw) -> list[Rival]:
        """Return where forces are so small that a finer field may have a minimum, if it may."""
        edges = self._edges
        coarse, fine = (
            edges.solution(gaps, prescribed, share).edge_opening for share in (1, FIELD_ACCURACY)
        )
        force = law.critical_of(gaps, coarse) ** 2 - coarse**2
        if norm(force) > 2 * norm(fine**2 - coarse**2):  # twice: the least is between two steps
            return []
        return [Point(prescribed, edges.field(gaps, prescribed), np.zeros(gaps.size), math.nan)]

    def ways_off_saddle(
        self, gaps: Array, prescribed: float, law: EdgeLaw, at_fold: bool = False
    ) -> list[Array]:
        """Move edges without force off a saddle of the energy; an empty list where they are stable.

        Near a fold (``at_fold``) edges with a mode that has softened count as not stable.
        Both directions along the softest modes are tried. That on which the force is larger is the
        first, of equal ones that in which the leading edge goes outwards. Where energy rises on
        both, half the step is tried: just beyond a pitchfork the minima beside the saddle are near.
        """
        edges = self._edges
        near, free = edges.response_at(gaps, prescribed, law), law.free_edges(gaps)
        if near is None or edges.critical == 0 or len(free) == 0:
            return []
        if not at_fold and near.solve(prescribed, law, edges.model).stable:
            return []
        tangent = near.tangent_between(gaps, free, prescribed, law, edges.model)
        by_edge = near.edge_opening[free, None] * tangent
        limit = step_limits(gaps, law.longest_step)[free]
        order = positions(gaps, edges.source.highest)[free]
        found = leaving_step(by_edge + by_edge.T, limit, order, EQUAL if at_fold else 0.0)
        if found is None:
            return []
        step = np.zeros(gaps.size)
        step[free] = found
        while np.abs(step).max() >= law.rest_step:
            ways: list[Array] = [move_edges(gaps, way) for way in (step, -step)]
            onwards = self._force_along(ways[0], step, prescribed, law)
            backwards = self._force_along(ways[1], -step, prescribed, law)
            if max(onwards, backwards) > 0:
                return ways if onwards >= backwards * (1 - EQUAL) else ways[::-1]
            step = 0.5 * step
        return []

    def _force_along(self, gaps: Array, step: Array, prescribed: float, law: EdgeLaw) -> float:
        """Compute the force along a ``step`` at its end: positive where the energy falls."""
        opening = self._edges.solution(gaps, prescribed).edge_opening
        residual = opening - law.critical_of(gaps, opening)
        return -float((residual * (2 * opening - residual)) @ step)

    def _smallest_of_last_gap(self, gaps: Array, smallest: float) -> float:
        """Return the length below which the last gap is closed.

        At fixed separation it never closes, however narrow it gets.

        Raises
        ------
        FullContact
            If it closes, where the separation is not fixed.
        """
        if len(gaps) > 1:
            return smallest
        length, _ = lengths_of(gaps)
        if length[0] < self._edges.smallest and self._edges.model.device.compliance > 0:
            raise FullContact
        return min(smallest, CLOSING_SHARE * float(length[0]))

    def _move_unbalanced(self, gaps: Array, prescribed: float, times: int, law: EdgeLaw) -> Array:
        """Move the most unbalanced edges on by ``times`` half a longest step.

        Next to a fold edges may be balanced to the field's error where Newton's iteration finds no
        minimum: the flow stands still there. A minimum draws the edges back. Edges with half as
        large an imbalance move, too: where one of two equal ones moved alone, it led to a minimum
        that both together pass, and a loss was wrong by 8 %.
        """
        opening = self._edges.solution(gaps, prescribed).edge_opening
        residual = opening - law.critical_of(gaps, opening)
        unbalanced = np.abs(residual) > 0.5 * np.abs(residual).max()
        step = step_limits(gaps, 0.5 * times * law.longest_step) * unbalanced
        return move_edges(gaps, -np.sign(residual) * step)


def leaving_step(hessian: Array, limit: Array, order: Array, balanced: float = 0.0) -> Array | None:
    """Step off a saddle, along its softest modes, up to the limit of an edge; None off a minimum.

    One edge leads, outwards; it is the one that moves most freely in these modes, of equal ones the
    first in ``order`` (positions). Where symmetry makes several modes equally soft, the step is the
    leading edge's projection on all of them: which of equivalent edges leads does not matter. It
    goes ahead a little: a symmetry that is left is no ridge, on which rounding would decide.
    """
    with one_thread():
        values, vectors = np.linalg.eigh(hessian)
    largest = np.abs(values).max()
    if not values[0] < balanced * largest:
        return None
    soft = vectors[:, values <= min(values[0] + EQUAL * largest, balanced * largest)]
    freedom = (soft**2).sum(axis=1)
    equal = np.flatnonzero(freedom > (1 - EQUAL) * freedom.max())
    leading = equal[np.argmin(order[equal])]
    step = soft @ soft[leading]
    step[leading] *= 1 + EQUAL
    return np.asarray(step / np.abs(step / limit).max())
