"""Mechanics of the contact edges of one problem: the choice between few and many gaps."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.descent.gradient_flow import AT_REST, NO_FIELD, REJOINED, VANISHED
from adhesis.solver.sharp.descent.track import Track
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.griffith import imbalance, shortest_length
from adhesis.solver.sharp.equilibrium.pinning import remember
from adhesis.solver.sharp.errors import FullContact, NoState
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.gap.ends import lengths_of, outward, without_small
from adhesis.solver.sharp.system.dense import DenseSystem
from adhesis.solver.sharp.system.edge_problem import EdgeProblem
from adhesis.solver.sharp.system.edge_system import EdgeSystem, Integers
from adhesis.solver.sharp.system.hierarchical import HierarchicalSystem
from adhesis.solver.sharp.system.kept_responses import KeptResponses
from adhesis.solver.sharp.system.window_descent import KnownState
from adhesis.solver.sharp.tolerances import (
    DESCENT_LIMIT,
    HIERARCHICAL_FROM,
    LAST_GAP,
    RESTS,
)

_ANY = np.empty(0, dtype=np.int64)  # gaps may have any kind


class EdgeMechanics(EdgeProblem):
    """Fields, equilibria and descents of the edges of one problem, in units of 1/q0.

    Attributes
    ----------
    many : int
        From so many gaps on the hierarchical system takes the place of the dense one.
    """

    many = HIERARCHICAL_FROM

    @cached_property
    def _systems(self) -> tuple[DenseSystem, HierarchicalSystem]:
        return DenseSystem(self), HierarchicalSystem(self)

    def system(self, gaps: Array) -> EdgeSystem:
        """Return the system of edges by which these gaps are solved."""
        return self._systems[len(gaps) >= self.many and not self.pins]

    def uses_windows(self, gaps: Array) -> bool:
        """Whether these gaps are followed in windows."""
        return self.system(gaps).uses_windows

    def field(self, gaps: Array, prescribed: float) -> GapField:
        """Solve the field of these gaps."""
        self.count.fields += 1
        return self.solved(gaps, prescribed, self.system(gaps).solution(gaps, prescribed, 1.0, 2))

    def field_again(
        self, gaps: Array, prescribed: float, pressure: float, separation: float
    ) -> GapField:
        """Return the field of gaps that were in equilibrium; of many it is solved when asked for.

        ``pressure`` (p) and ``separation`` (q0 s) are those of the equilibrium.
        """
        if self.uses_windows(gaps):
            return self._systems[1].field_on_demand(gaps, prescribed, pressure, separation)
        return self.field(gaps, prescribed)

    def stiffness(self, point: Point, edges: Integers) -> Array:
        """Return ∂C_e/∂n_f between some edges, n outward, the others held, shape (edges, edges).

        The diagonal is not given for many gaps.
        """
        by_edge = self.system(point.gaps).stiffness(point, edges)
        return np.asarray(by_edge * outward(point.gaps)[edges])

    def equilibrium(
        self,
        gaps: Array,
        prescribed: float,
        reach: float,
        orders: Integers = _ANY,
        *,
        strict: bool = True,
    ) -> Point | None:
        """Return the stable equilibrium near these gaps, or None.

        None if an edge would move further than ``reach`` (in θ), the iteration stalls, or the
        equilibrium is not stable. ``orders`` are the least orders of the gaps. Unless
        ``strict``, gaps that are nearly in equilibrium are taken as they are.
        """
        if not shortest_length(gaps) > 0:
            return None
        try:
            return self.system(gaps).equilibrium(
                gaps, prescribed, max(reach, self.settled), orders, strict=strict
            )
        except np.linalg.LinAlgError:
            return None

    @property
    def responses(self) -> KeptResponses:
        """Linear responses of many gaps."""
        return self._systems[1].responses

    def start(self, point: Point | None) -> KnownState | None:
        """Return ``point`` as the start of a descent in a window; None for few gaps."""
        if point is None or not self.uses_windows(point.gaps):
            return None
        return self._systems[1].start(point)

    def forget(self) -> None:
        """Forget what results would depend on within the error of the field."""
        self.responses.forget()

    def relax(
        self,
        gaps: Array,
        prescribed: float,
        reach: float,
        *,
        equal_speeds: bool = False,
        track: Track | None = None,
        start: KnownState | None = None,
    ) -> Point | Array:
        """Descend in energy at a prescribed value to the next minimum.

        By linear kinetics, which extends the ``track``; or, to be compared with that, with
        ``equal_speeds`` or from where the track has been left, until the track is met. From a
        ``start`` in a window.

        Returns
        -------
        Point or array
            The minimum, or the gaps without those gaps and patches that have closed or vanished on
            the way (an empty array when no contact is left, or the track is met).

        Raises
        ------
        PathError
            If the descent does not end, or comes to edges that have no field.
        FullContact
            If the last gap closes, as it may where the separation is not fixed.
        """
        # Without adhesion the minimum is unique, and the Hessian vanishes there: linear kinetics
        # would not come to rest.
        equal_speeds = equal_speeds or self.critical == 0
        track = track or Track()
        system, law = self.system(gaps), self.law
        left, orders, rests = DESCENT_LIMIT, _ANY, 0
        begun, rested = len(gaps), np.empty((0, 2))
        while left > 0 and rests <= 2 * RESTS:
            held = self.law_of(gaps).held
            law = law._replace(held=held)
            end = system.descend(
                gaps, prescribed, left, orders, law, track, equal_speeds=equal_speeds, start=start
            )
            gaps, orders, start = end.gaps, end.orders, None
            left -= end.fields
            if end.event == REJOINED:
                track.rejoined = True
                return np.empty((0, 2))
            if end.event == NO_FIELD:
                raise NoState("there is no field of these edges", prescribed)
            if end.event == VANISHED:
                self.recall(remember(held, gaps, law.band) if self.pins else held)
                rest = without_small(gaps, self.smallest)
                if rest is not None:
                    return rest
                if len(gaps) != begun:
                    return gaps
                law = law._replace(smallest=self._smallest_of_last_gap(gaps, law.smallest))
            if end.event == AT_REST:
                # Next to a fold the field's error may hide whether there is a minimum; whatever
                # is taken for it, the next step in s decides.
                rests += 1
                if gaps.shape == rested.shape and np.abs(gaps - rested).max() < self.settled:
                    rests = max(rests, RESTS + 1)  # no patience changes anything
                rested = gaps
                strict = rests <= RESTS
                point = self.equilibrium(gaps, prescribed, reach, orders, strict=strict)
                if point is not None:
                    return point
                if not strict and rests <= 2 * RESTS:
                    gaps = self._perturb_most_unbalanced(gaps, prescribed, rests - RESTS)
        raise NoState("edges that descend in energy do not come to rest", prescribed)

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
        return min(smallest, LAST_GAP * float(length[0]))

    def _perturb_most_unbalanced(self, gaps: Array, prescribed: float, times: int) -> Array:
        """Move the most unbalanced edge on by ``times`` half a longest step.

        Next to a fold edges may be balanced to the field's error where Newton's iteration finds no
        minimum: the flow stands still there. A minimum draws the edge back.
        """
        solution = self.field(gaps, prescribed).solution
        residual, _ = imbalance(solution, self.law_of(gaps), self.source.panels)
        e = int(np.argmax(np.abs(residual)))
        length, patch = lengths_of(gaps)
        beside = patch[e // 2 - 1 if e % 2 == 0 else e // 2]
        step = np.zeros(gaps.size)
        step[e] = min(0.5 * times * self.law.longest_step, 0.25 * length[e // 2], 0.25 * beside)
        onwards: Array = gaps - (np.sign(residual[e]) * outward(gaps) * step).reshape(-1, 2)
        return onwards
