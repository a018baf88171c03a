"""Mechanics of the contact edges of one problem: fields, equilibria and descents of its gaps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from adhesis.solver._kernels import (
    CLOSING_SHARE,
    DescentEvent,
    EdgeLaw,
    Equilibrium,
    Field,
    FieldModel,
    solve_field,
)
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.equilibrium.branch_point import PinnedEdges, Point
from adhesis.solver.sharp.equilibrium.griffith import (
    imbalance,
    leaving_step,
    positions,
    step_limits,
)
from adhesis.solver.sharp.errors import FullContact, NoState
from adhesis.solver.sharp.field.gap_field import (
    FixedEdgeResponse,
    GapField,
    respond_at_fixed_edges,
)
from adhesis.solver.sharp.gap.ends import lengths_of, move_edges, without_small
from adhesis.solver.sharp.system.edge_problem import EdgeProblem
from adhesis.solver.sharp.system.kept_response import KeptResponse
from adhesis.solver.sharp.tolerances import (
    ENDLESS,
    EQUAL,
    FIELD_ACCURACY,
    RESTS,
)


class EdgeMechanics(EdgeProblem):
    """Fields, equilibria and descents of the edges of one problem, in units of 1/q0.

    The linear response of the gaps is kept from one state to the next.
    """

    def __init__(self, *problem: Any) -> None:
        super().__init__(*problem)
        self.kept = KeptResponse(self)
        self._finer: tuple[Point, Field] | None = None

    def solution(self, gaps: Array, prescribed: float, share: float = 1.0) -> Field:
        """Solve the field of these gaps to a ``share`` of the tolerance."""
        self.count.fields += 1
        model = self.model
        if share < 1:
            model = FieldModel(model.device, model.digits - math.log(share), model.panels)
        return solve_field(gaps, prescribed, model)

    def field(
        self, gaps: Array, prescribed: float, nearly: tuple[float, float] | None = None
    ) -> GapField:
        """Return the field of these gaps, with p and q0 s where they are known."""
        return GapField(
            self.source, gaps, prescribed, lambda: self.solution(gaps, prescribed), nearly
        )

    def release(self, gaps: Array, prescribed: float, theta: float, half: float) -> Array:
        """Compute G/γ at the two edges next to θ ± ``half``, all edges being held."""
        ends = gaps.ravel()
        apart = (ends - theta - half * np.array([[-1.0], [1.0]]) + np.pi) % (2 * np.pi) - np.pi
        nearest = np.abs(apart).argmin(axis=1)
        opening = self.field(gaps, prescribed).opening.ravel()[nearest]
        work = np.array([self.adhesion.work(end, False)[0] for end in ends[nearest]])
        return np.asarray(np.maximum(opening, 0.0) ** 2 / (self.critical**2 * work))

    def response_before_fold(self, point: Point) -> FixedEdgeResponse:
        """Return the response at a point next to a fold, the edges held."""
        return respond_at_fixed_edges(self._solve_finer(point))

    def fold_displacement(self, point: Point) -> float:
        """Estimate how far in d the error of the field displaces the fold next to a point.

        The error of the openings is their difference from those of a more accurate field.
        """
        finer = self._solve_finer(point)
        change = finer.opening - point.field.solution.opening
        return point.fold_displacement(change, respond_at_fixed_edges(finer).opening)

    def _solve_finer(self, point: Point) -> Field:
        """Solve the field of a point more accurately than that of the path."""
        if self._finer is None or self._finer[0] is not point:
            self._finer = point, self.solution(point.gaps, point.d, FIELD_ACCURACY)
        return self._finer[1]

    def equilibrium(
        self,
        gaps: Array,
        prescribed: float,
        reach: float,
        *,
        strict: bool = True,
        memory: Array | None = None,
    ) -> Point | None:
        """Return the equilibrium near these gaps, a stable one if ``strict``, or None.

        None if an edge would move further than ``reach`` (in θ), the iteration stalls, or the
        equilibrium is not stable. Unless ``strict``, gaps that are nearly in equilibrium are taken
        as they are, stable or not: a minimum next to a fold, or a saddle. ``memory`` is where
        the edges were in the state before, which matters with two works of adhesion; here if not
        given.
        """
        reach = max(reach, self.newton_tolerance)
        law = self.law_at(gaps if memory is None else memory)
        near = self.kept.near(gaps, prescribed)
        if near is None:
            return None
        found = near.find_equilibrium(gaps, prescribed, reach, strict, law, self.model)
        self.count.newton_steps += found.corrections
        self.count.fields += found.corrections
        if not found.found:
            if math.isnan(found.pressure):
                self.kept.forget()
            return None
        point = self._point(prescribed, found)
        self.kept.settled = point.gaps
        return point

    def _point(self, prescribed: float, found: Equilibrium) -> Point:
        """Make the point of an equilibrium."""
        gaps = found.gaps
        nearly = found.pressure, found.separation
        field = GapField(
            self.source, gaps, prescribed, lambda: found.solve_field(prescribed, self.model), nearly
        )
        pinned = PinnedEdges(found.pinned_share, found.pinned_rate) if self.pins else None
        return Point(prescribed, field, found.rate, found.slope, pinned=pinned)

    def forget(self) -> None:
        """Forget what results would depend on within the error of the field."""
        self.kept.forget()

    def relax(
        self,
        gaps: Array,
        prescribed: float,
        reach: float,
        *,
        equal_speeds: bool = False,
        share: float = 1.0,
    ) -> tuple[Point | Array, bool]:
        """Descend in energy at a prescribed value to the next minimum.

        By linear kinetics, or with ``equal_speeds``, to be compared with that; in steps of at most
        this share of the longest.

        Returns
        -------
        Point or array
            The minimum, or the gaps without those gaps and patches that have closed or vanished on
            the way (an empty array when no contact is left).
        bool
            Whether the order in which edges ran may have decided that.

        Raises
        ------
        PathError
            If the descent does not end, or comes to edges that have no field.
        FullContact
            If the last gap closes, as it may where the separation is not fixed.
        """
        law = EdgeLaw(self.law_at(gaps))
        law.longest_step *= share
        left, rests, raced = ENDLESS, 0, False
        rested, start = np.empty((0, 2)), gaps
        while left > 0 and rests <= 2 * RESTS:
            near = self.kept.near(gaps, prescribed)
            if near is None:
                raise NoState("there is no field of these edges", prescribed)
            end = near.descend(gaps, start, prescribed, left, equal_speeds, law, self.model)
            left -= end.steps
            self.count.descent_steps += end.steps
            self.count.fields += end.steps
            if end.event == DescentEvent.NO_FIELD:
                self.kept.forget()
                raise NoState("there is no field of these edges", prescribed)
            gaps, raced = end.gaps, raced or end.raced
            if end.event == DescentEvent.VANISHED:
                rest = without_small(gaps, self.smallest)
                if rest is not None:
                    return rest, raced
                law = EdgeLaw(law)
                law.smallest = self._smallest_of_last_gap(gaps, law.smallest)
            if end.event == DescentEvent.AT_REST:
                # Next to a fold the field's error may hide whether there is a minimum; whatever
                # is taken for it, the next step in s decides.
                rests += 1
                if (
                    gaps.shape == rested.shape
                    and np.abs(gaps - rested).max() < self.newton_tolerance
                ):
                    rests = max(rests, RESTS + 1)  # no patience changes anything
                rested = gaps
                strict = rests <= RESTS
                point = self.equilibrium(gaps, prescribed, reach, strict=strict, memory=law.memory)
                if point is not None:
                    return point, raced
                ways = self.ways_off_saddle(gaps, prescribed, law)
                if ways:
                    gaps = ways[0]
                elif not strict and rests <= 2 * RESTS:
                    gaps = self._perturb_most_unbalanced(gaps, prescribed, rests - RESTS, law)
        raise NoState("edges that descend in energy do not come to rest", prescribed)

    def ways_off_saddle(self, gaps: Array, prescribed: float, law: EdgeLaw) -> list[Array]:
        """Move edges without force off a saddle of the energy; an empty list where they are stable.

        Both directions along the softest modes are tried. That on which the force is larger is the
        first, of equal ones that in which the leading edge goes outwards. Where energy rises on
        both, half the step is tried: just beyond a pitchfork the minima beside the saddle are near.
        """
        near, free = self.kept.at(gaps, prescribed), law.free_edges(gaps)
        if near is None or self.critical == 0 or len(free) == 0:
            return []
        tangent = near.tangent_between(gaps, free, prescribed, law, self.model)
        by_edge = near.opening[free, None] * tangent
        limit = step_limits(gaps, law.longest_step)[free]
        order = positions(gaps, self.source.highest)[free]
        found = leaving_step(by_edge + by_edge.T, limit, order)
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
        opening = self.solution(gaps, prescribed).opening
        residual = imbalance(opening, gaps, law)
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
        if length[0] < self.smallest and self.model.device.compliance > 0:
            raise FullContact
        return min(smallest, CLOSING_SHARE * float(length[0]))

    def _perturb_most_unbalanced(
        self, gaps: Array, prescribed: float, times: int, law: EdgeLaw
    ) -> Array:
        """Move the most unbalanced edge on by ``times`` half a longest step.

        Next to a fold edges may be balanced to the field's error where Newton's iteration finds no
        minimum: the flow stands still there. A minimum draws the edge back.
        """
        opening = self.solution(gaps, prescribed).opening
        residual = imbalance(opening, gaps, law)
        e = int(np.argmax(np.abs(residual)))
        step = np.zeros(gaps.size)
        step[e] = -np.sign(residual[e]) * step_limits(gaps, 0.5 * times * law.longest_step)[e]
        return move_edges(gaps, step)
