"""Moving real-valued edges: equilibrium by Newton, stability, and descent along a jump.

The unknowns are the gap ends θ_e. An edge is in equilibrium where its opening C_e equals the
critical one, C_c = 4 sqrt(q0 γ sqrt(1+h'²) / (π E*)) (Griffith); contact advances where C_e < C_c.
With n_e the outward motion of the contact at edge e, the energy of the edges is stable where the
matrix ∂(C_e - C_c)/∂n_f is positive definite (scaled by sqrt(C_e/C_f) it is symmetric: it is the
Hessian of the energy divided by C).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.method import PathError
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.counters import Counters
from adhesis.solver.sharp.descent.gradient_flow import LOST, MET, NARROW, RESTING, descend
from adhesis.solver.sharp.descent.local_descent import Start
from adhesis.solver.sharp.descent.windowed_descent import descend_many
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.equilibrium.edge_elimination import openings_between_edges
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw, imbalance, shortest_length
from adhesis.solver.sharp.equilibrium.hierarchical_newton import equilibrium_many
from adhesis.solver.sharp.equilibrium.linear_exterior import Linearisation, linearise_equilibrium
from adhesis.solver.sharp.equilibrium.newton import equilibrium
from adhesis.solver.sharp.field.dense_solver import GapField
from adhesis.solver.sharp.field.exterior import NO_EXTERIOR
from adhesis.solver.sharp.field.hierarchical_solver import solve_many
from adhesis.solver.sharp.field.solution import FIXED_SEPARATION, FieldModel, LoadingDevice
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.ends import outward, widths, without_small
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, choose_orders

MANY = 30  # from so many gaps on, windows and the tree of gaps replace dense matrices
CORRECTED = 0.05  # longest correction of an equilibrium that is looked for nearby, in λ_min
_NEAR = 1e-3  # descent steps shorter than this (in λ_min) are left to Newton's iteration
_DESCENT_LIMIT = 100_000
_RESTS = 20  # how often a descent may come to rest without a minimum that Newton's iteration finds
_FAINT = 10.0  # forces this small, in units of the field's tolerance, are its error
_ANY = np.empty(0, dtype=np.int64)  # gaps may have any kind
_ALIKE = 0.01  # edges of two descents that come to rest so near to each other, in λ_min, have met


class Stage(NamedTuple):
    """Part of a descent with one set of gaps.

    Attributes
    ----------
    way : array, shape (2L,)
        Outward motion of every edge.
    taken : array, shape (2L, 2L)
        Force, as C², that the motion of each edge (columns) took from every edge (rows).
    """

    way: Array
    taken: Array


@dataclass
class Track:
    """Edges that a descent went through, for another one to be compared with.

    Attributes
    ----------
    ways : list of arrays, shape (n, 2L)
        One for every set of gaps on the way.
    astray, met : bool
        Whether the other descent has left the track, and come back to it.
    rest : array, optional
        Gaps of a window in which the descent first came to rest.
    stages : list of Stage
        What the edges did, one for every set of gaps on the way.
    whole : bool
        Whether the stages are known.
    """

    ways: list[Array] = field(default_factory=list)
    astray: bool = False
    met: bool = False
    rest: Array | None = None
    stages: list[Stage] = field(default_factory=list)
    whole: bool = True

    def of(self, edges: int) -> Array:
        """The track where there are so many edges."""
        return np.concatenate(
            [np.empty((0, edges)), *(w for w in self.ways if w.shape[1] == edges)]
        )


class FullContact(Exception):
    """The last gap of the period closes: no state of gaps is left."""


class NoState(PathError):
    """The path has no state at d = ``at``; the text is the reason."""

    def __init__(self, reason: str, at: float) -> None:
        super().__init__(reason)
        self.at = at


class EdgeMechanics:
    """Openings, equilibrium and stability of the edges of one problem, in units of 1/q0.

    Parameters
    ----------
    source : StressSource
    critical : float
        4 sqrt(q0 γ/(π E*)): the critical opening on a flat piece.
    tolerance : float
        Relative accuracy of the field.
    device : LoadingDevice
        What is prescribed.

    Attributes
    ----------
    many : int
        From so many gaps on they are solved on a tree and moved in windows.
    lost : int
        Edge that led away where :meth:`equilibrium` of many gaps last found none; -1 if unknown.
    """

    def __init__(
        self,
        source: StressSource,
        critical: float,
        tolerance: float,
        device: LoadingDevice = FIXED_SEPARATION,
    ) -> None:
        self.source, self.critical, self.tolerance = source, critical, tolerance
        self.wave = 2 * np.pi / source.top  # shortest wavelength in θ
        self.settled = 1e-7 * self.wave  # a correction this small ends Newton's iteration
        # How far an equilibrium may move with the error of the field.
        self.coarse = max(self.settled, 10 * tolerance * self.wave)
        # Steps above 0.1 λ_min leap over pinned minima; an edge that runs alone takes twice this.
        self.longest_step = 0.05 * self.wave
        # Narrower patches and gaps are gone: far below the width at which a patch on the sharpest
        # crest first comes to rest, (16 Γ/(π κ²))^(1/3) with Γ = π C_c²/8.
        seed = (2 * critical**2 / source.sharpest**2) ** (1 / 3)
        self.smallest = 0.005 * self.wave
        if critical > 0:
            self.smallest = min(self.smallest, 0.05 * seed)
        # an opening this far below zero is an overlap that descent cannot weigh
        rough = np.sqrt(source.m2 * self.wave)
        self.law = EdgeLaw(
            critical=float(critical),
            newton_tolerance=self.settled,
            field_error=self.coarse,
            rest_step=_NEAR * self.wave,
            longest_step=self.longest_step,
            smallest=float(self.smallest),
            overlap_limit=float(0.1 * max(critical, rough)),
            force_error=max(_FAINT * tolerance, 1e-12) * float(critical) ** 2,
            origin=source.highest,
        )
        self.model = FieldModel(
            device=device,
            digits=float(-np.log(tolerance)),
            rules=GAUSS_RULES,
            panels=source.panels,
        )
        self.many = MANY
        self.lost = -1
        self.count = Counters()

    def field(self, gaps: Array, prescribed: float, *, share: float = 1.0) -> GapField:
        """Solve the field of these gaps, to a ``share`` of the tolerance."""
        self.count.fields += 1
        solution = None
        if len(gaps) >= self.many:
            model = self.model._replace(digits=self.model.digits - math.log(share))
            orders = choose_orders(map_gaps(gaps), model.digits, GAUSS_RULES.counts)
            solution, _ = solve_many(gaps, prescribed, orders, 2, model)
        tolerance = share * self.tolerance
        return GapField(self.source, gaps, prescribed, tolerance, self.model.device, solution)

    def stiffness(self, point: Point, edges: NDArray[np.int64]) -> Array:
        """∂C_e/∂n_f between some edges, n outward, the others held, shape (edges, edges).

        The diagonal is not given for many gaps.
        """
        gaps = point.gaps
        if len(gaps) < self.many:
            by_edge = point.field.derivatives[0][np.ix_(edges, edges)]
        else:
            orders = point.field.solution.nodes.orders
            by_edge = openings_between_edges(gaps, point.at, orders, edges, self.model)
        return np.asarray(by_edge * outward(gaps)[edges])

    def equilibrium(
        self,
        gaps: Array,
        prescribed: float,
        reach: float,
        kinds: NDArray[np.int64] = _ANY,
        *,
        patient: bool = True,
    ) -> Point | None:
        """Stable equilibrium near these gaps, or None.

        None if an edge would move further than ``reach`` (in θ), the iteration stalls, or the
        equilibrium is not stable. ``kinds`` are the least kinds of the gaps. If not ``patient``,
        gaps that are nearly in equilibrium are taken as they are.
        """
        if not shortest_length(gaps) > 0:
            return None
        try:
            given = (
                gaps, prescribed, max(reach, self.settled), kinds, patient, self.law, self.model
            )  # fmt: skip
            linearisation: Linearisation | None = None
            if len(gaps) < self.many:
                found, at, solution, rate, slope, steps = equilibrium(*given, NO_EXTERIOR)
            else:
                found, at, linearisation, rate, slope, steps = equilibrium_many(*given)
                solution = linearisation.solution
        except np.linalg.LinAlgError:
            return None
        self.count.newton_steps += steps
        self.count.fields += steps
        self.count.derivatives += steps
        if not found:
            self.lost = -1
            if len(gaps) >= self.many and np.isfinite(rate).all():
                self.lost = int(np.argmax(np.abs(rate)))
            return None
        field = GapField(self.source, at, prescribed, self.tolerance, self.model.device, solution)
        return Point(prescribed, field, rate, slope, linearisation=linearisation)

    def linearisation(self, point: Point) -> Linearisation:
        """Linearise a point of many gaps, for windows on it."""
        if point.linearisation is not None:
            return point.linearisation
        self.count.fields += 1
        self.count.derivatives += 1
        known: Linearisation = linearise_equilibrium(
            point.gaps, point.at, point.field.solution.nodes.orders, self.law, self.model
        )
        return known

    def start(self, point: Point | None) -> Start | None:
        """``point`` as the start of a descent in a window; None for few gaps."""
        if point is None or len(point.gaps) < self.many:
            return None
        leads = int(np.argmax(np.abs(point.rate))) // 2
        return Start(point.gaps, self.linearisation(point), leads)

    def _begun(
        self, start: Start, gaps: Array, prescribed: float, reach: float, equal_speeds: bool,
        track: Track,
    ) -> Point | Array | None:  # fmt: skip
        """As :meth:`relax`, in a window on a known state; gaps to go on from if that is no end."""
        rest = start.descend(
            gaps, prescribed, self.law, self.model, self.count, self.smallest,
            equal_speeds=equal_speeds,
        )  # fmt: skip
        if rest is None:
            return None
        if rest.ended == RESTING:
            if not equal_speeds:
                track.rest = rest.local
            elif track.rest is not None and track.rest.shape == rest.local.shape:
                track.met = bool(np.abs(track.rest - rest.local).max() < _ALIKE * self.wave)
            point = None if track.met else self.equilibrium(rest.gaps, prescribed, reach)
            if point is not None:
                return point
        return rest.gaps

    def relax(
        self,
        gaps: Array,
        prescribed: float,
        reach: float,
        *,
        equal_speeds: bool = False,
        track: Track | None = None,
        start: Start | None = None,
    ) -> Point | Array:
        """Descend in energy, what is prescribed being fixed, to the next minimum.

        By linear kinetics, which leaves its ``track``; or with ``equal_speeds`` by the rule it is
        compared with, until that has met the track. From a ``start`` in a window.

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
        # Without adhesion the minimum is unique, and the energy's slope vanishes there twice.
        equal_speeds = equal_speeds or self.critical == 0
        law = self.law
        left = _DESCENT_LIMIT
        kinds = _ANY
        rests = 0
        track = track or Track()
        other = track.of(gaps.size if equal_speeds else 0)
        if start is not None and len(gaps) >= self.many:
            track.whole = False
            begun = self._begun(start, gaps, prescribed, reach, equal_speeds, track)
            if isinstance(begun, Point):
                return begun
            if track.met:
                return np.empty((0, 2))
            if begun is not None:
                gaps = begun
                rest = without_small(gaps, self.smallest)
                if rest is not None:
                    return rest
        while left > 0:
            if len(gaps) < self.many:
                begin = gaps
                gaps, ended, fields, tangents, kinds, way, track.astray, taken = descend(
                    gaps, prescribed, left, kinds, equal_speeds, law, self.model, NO_EXTERIOR,
                    other, track.astray,
                )  # fmt: skip
                if not equal_speeds:
                    track.ways.append(way)
                    moved = outward(gaps) * (gaps - begin).ravel()
                    track.stages.append(Stage(moved, taken))
            else:
                track.whole = False
                gaps, ended, fields, tangents, kinds = descend_many(
                    gaps, prescribed, left, kinds, equal_speeds, law, self.model
                )
            self.count.fields += fields
            self.count.descent_steps += fields
            self.count.derivatives += tangents
            left -= fields
            if ended == MET:
                track.met = True
                return np.empty((0, 2))
            if ended == LOST:
                raise NoState("there is no field of these edges", prescribed)
            if ended == NARROW:
                rest = without_small(gaps, self.smallest)
                if rest is not None:
                    return rest
                if len(gaps) == 1:
                    length, _ = widths(gaps)
                    if length[0] < self.smallest and self.model.device.compliance > 0:
                        raise FullContact
                    # at fixed separation the last gap never closes, however narrow it gets
                    law = law._replace(smallest=min(law.smallest, 0.05 * float(length[0])))
            if ended == RESTING:
                # Next to a fold the field's error may hide whether there is a minimum; whatever
                # is taken for it, the next step in s decides.
                rests += 1
                patient = rests <= _RESTS
                point = self.equilibrium(gaps, prescribed, reach, kinds, patient=patient)
                if point is not None:
                    return point
                if rests > 2 * _RESTS:
                    break
                if not patient:
                    gaps = self._pushed_on(gaps, prescribed, rests - _RESTS)
        raise NoState("edges that descend in energy do not come to rest", prescribed)

    def _pushed_on(self, gaps: Array, prescribed: float, times: int) -> Array:
        """Gaps whose most unbalanced edge has gone on, ``times`` half a longest step.

        Next to a fold edges may be balanced to the field's error where Newton's iteration finds no
        minimum: the flow stands still there. A minimum draws the edge back.
        """
        residual, _ = imbalance(self.field(gaps, prescribed).solution, self.law, self.source.panels)
        e = int(np.argmax(np.abs(residual)))
        length, patch = widths(gaps)
        beside = patch[e // 2 - 1 if e % 2 == 0 else e // 2]
        step = np.zeros(gaps.size)
        step[e] = min(0.5 * times * self.law.longest_step, 0.25 * length[e // 2], 0.25 * beside)
        onwards: Array = gaps - (np.sign(residual[e]) * outward(gaps) * step).reshape(-1, 2)
        return onwards
