"""Moving real-valued edges: equilibrium by Newton, stability, and descent along a jump.

The unknowns are the gap ends θ_e. An edge is in equilibrium where its opening C_e equals the
critical one, C_c = 4 sqrt(q0 γ sqrt(1+h'²) / (π E*)) (Griffith); contact advances where C_e < C_c.
With n_e the outward motion of the contact at edge e, the energy of the edges is stable where the
matrix ∂(C_e - C_c)/∂n_f is positive definite (scaled by sqrt(C_e/C_f) it is symmetric: it is the
Hessian of the energy divided by C).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from solver.profile import Array
from solver.sharp_gaps import GapField
from solver.sharp_run import run_held
from solver.sharp_source import StressSource
from solver.sharp_step import off_saddle, running_step

_REUSES = 8  # running steps that share one tangent
_NEWTON_LIMIT = 8  # corrections before an equilibrium counts as lost


@dataclass
class Counters:
    """What the work cost: field solutions, derivative solutions, fine openings and energies."""

    fields: int = 0
    derivatives: int = 0
    energies: int = 0
    openings: int = 0
    newton_steps: int = 0
    descent_steps: int = 0


@dataclass(frozen=True, eq=False)
class Held:
    """Symmetric tangent with its scale factors, for the next running steps."""

    d: Array
    matrix: Array
    last: Array  # the step taken with it
    runners: int  # edges that ran in that step; 0: the tangent is used up


class EdgeMechanics:
    """Openings, equilibrium and stability of the edges of one problem, in units of 1/q0.

    Parameters
    ----------
    source : StressSource
    critical : float
        4 sqrt(q0 γ/(π E*)): the critical opening on a flat piece.
    tolerance : float
        Relative accuracy of the field.
    """

    def __init__(self, source: StressSource, critical: float, tolerance: float) -> None:
        self.source, self.critical, self.tolerance = source, critical, tolerance
        self.wave = 2 * np.pi / source.top  # shortest wavelength in θ
        self.settled = 1e-7 * self.wave  # a correction this small ends Newton's iteration
        # Steps above 0.1 λ_min leap over pinned minima. Where two edges race, which minimum is
        # reached can depend on the step down to 0.05 λ_min, below which no loop was seen to change;
        # an edge that runs alone takes twice that.
        self.longest_step = 0.05 * self.wave
        # Narrower patches and gaps are gone: far below the width at which a patch on the sharpest
        # crest first comes to rest, (16 Γ/(π κ²))^(1/3) with Γ = π C_c²/8.
        seed = (2 * critical**2 / source.sharpest**2) ** (1 / 3)
        self.smallest = 0.005 * self.wave
        if critical > 0:
            self.smallest = min(self.smallest, 0.05 * seed)
        # an opening this far below zero is an overlap that descent cannot weigh
        rough = np.sqrt(source.m2 * self.wave)
        self.overlapping = 0.1 * max(critical, float(rough))
        self.count = Counters()

    def field(
        self, gaps: Array, separation: float, kinds: NDArray[np.intp] | None = None
    ) -> GapField:
        """Solve the field of these gaps."""
        self.count.fields += 1
        return GapField(self.source, gaps, separation, self.tolerance, kinds)

    def residual(self, field: GapField) -> Array:
        """C_e - C_c at every edge, shape (2L,); positive where contact recedes."""
        measure, _ = self.source.measure_at(field.gaps.ravel())
        return np.asarray(field.opening.ravel() - self.critical * np.sqrt(measure))

    def tangent(self, field: GapField) -> Array:
        """∂(C_e - C_c)/∂n_f, shape (2L, 2L), n the outward motion of the contact."""
        self.count.derivatives += 1
        by_edge, _ = field.derivatives
        measure, slope = self.source.measure_at(field.gaps.ravel())
        matrix = by_edge.copy()
        matrix[np.diag_indices_from(matrix)] -= self.critical * slope / (2 * np.sqrt(measure))
        return matrix * outward(field.gaps)

    def symmetric(self, field: GapField, tangent: Array) -> tuple[Array, Array]:
        """Scale factors d and the symmetric matrix d_e tangent_ef / d_f."""
        c = field.opening.ravel()
        d = np.sqrt(np.maximum(c, self.overlapping))
        scaled = tangent * (d[:, None] / d[None, :])
        return d, np.asarray((scaled + scaled.T) / 2)

    def widths(self, gaps: Array) -> tuple[Array, Array]:
        """Lengths of the gaps, and of the patches to the right of each, shape (L,)."""
        patch = np.empty(len(gaps))
        patch[:-1] = gaps[1:, 0]
        patch[-1] = gaps[0, 0] + 2 * np.pi
        return gaps[:, 1] - gaps[:, 0], patch - gaps[:, 1]

    def valid(self, gaps: Array) -> bool:
        """Whether every gap and patch has a positive length."""
        length, patch = self.widths(gaps)
        return bool(length.min() > 0 and patch.min() > 0)

    def equilibrium(
        self, gaps: Array, separation: float, reach: float
    ) -> tuple[GapField, Array] | None:
        """Newton's iteration for C_e = C_c from nearby edges.

        Returns the field and its tangent at the equilibrium, or None if an edge would move further
        than ``reach`` (in θ), the iteration stalls, or the equilibrium is not stable.
        """
        start = gaps.ravel()
        at = start.copy()
        last = np.inf
        sign = outward(gaps)
        kinds = None
        for _ in range(_NEWTON_LIMIT):
            self.count.newton_steps += 1
            trial = at.reshape(-1, 2)
            if not self.valid(trial):
                return None
            field = self.field(trial, separation, kinds)
            kinds = field.kinds
            tangent = self.tangent(field)
            try:
                step = -sign * np.linalg.solve(tangent, self.residual(field))
            except np.linalg.LinAlgError:
                return None
            size = float(np.abs(step).max())
            if not np.isfinite(size) or size > max(reach, self.settled) or size > 2 * last:
                return None
            if size <= self.settled:
                return (field, tangent) if self.stable(field, tangent) else None
            at = at + step
            if np.abs(at - start).max() > reach:
                return None
            last = size
        return None

    def stable(self, field: GapField, tangent: Array) -> bool:
        """Whether the equilibrium is a minimum of the energy."""
        _, matrix = self.symmetric(field, tangent)
        try:
            np.linalg.cholesky(matrix)
        except np.linalg.LinAlgError:
            return False
        return True

    def descend(self, gaps: Array, separation: float, held: Held | None) -> tuple[Array, Held]:
        """Take one step of energy descent at fixed separation.

        Edges out of equilibrium run in the direction in which the energy falls, all at the same
        speed (their limit, twice as long for one that runs alone); edges near equilibrium follow
        them by Newton's step. A patch or gap loses at most a quarter of its length to each edge.
        While edges run, the tangent of a few steps before (``held``) does as well, unless an edge
        turns; the openings are always fresh.
        """
        self.count.descent_steps += 1
        if held is not None and held.runners and len(held.d) == gaps.size:
            moved, _, _, fields, turns = run_held(
                self.source, gaps, separation, self.tolerance, (held.matrix, held.d), held.last,
                held.runners, _REUSES,
                (self.longest_step, self.smallest, self.overlapping), self.critical,
            )  # fmt: skip
            self.count.fields += fields
            self.count.descent_steps += fields - 1
            if fields > 1 or not turns:
                return moved, replace(held, runners=0)
        field = self.field(gaps, separation)
        limit = self._limits(gaps, self.longest_step)
        d, matrix = self.symmetric(field, self.tangent(field))
        step = running_step(matrix, d, -self.residual(field), limit)
        # Where surfaces would overlap beside an edge there is nothing to weigh: contact advances.
        step = np.where(field.opening.ravel() < -self.overlapping, limit, step)
        if np.abs(step).max() <= self.settled and not self.stable(field, self.tangent(field)):
            step = off_saddle(matrix, d, limit)
        runners = int(np.count_nonzero(np.abs(step) > 0.5 * self.longest_step))
        moved = (gaps.ravel() + outward(gaps) * step).reshape(-1, 2)
        return moved, Held(d, matrix, step, runners)

    def _limits(self, gaps: Array, longest: float) -> Array:
        """Longest step of each edge: ``longest``, or a quarter of the gap or patch it may close."""
        length, patch = self.widths(gaps)
        limit = np.empty_like(gaps)
        limit[0, 0] = patch[-1]
        limit[1:, 0] = patch[:-1]
        limit[:, 1] = patch
        np.minimum(limit, length[:, None], out=limit)
        return np.asarray(np.minimum(longest, 0.25 * limit).ravel())


def outward(gaps: Array) -> Array:
    """+1 at left gap ends, where contact grows to the right, -1 at right ones, shape (2L,)."""
    sign = np.ones(2 * len(gaps))
    sign[1::2] = -1.0
    return sign


def without_gaps(gaps: Array, keep: NDArray[np.bool_]) -> Array:
    """Drop the closed gaps: their patches merge."""
    return gaps[keep]


def without_patches(gaps: Array, keep: NDArray[np.bool_]) -> Array:
    """Drop patches, ``keep`` telling of the patch to the right of each gap: their gaps join."""
    if not keep.any():
        return np.empty((0, 2))
    # A gap starts after a kept patch (the one to the left of gap k is patch k - 1).
    lefts = gaps[np.roll(keep, 1), 0]
    rights = gaps[keep, 1]
    first = lefts[0]
    rights = np.sort(np.where(rights <= first, rights + 2 * np.pi, rights))
    return np.stack([lefts, rights], axis=1)


def with_patches(gaps: Array, centres: Array, widths: Array) -> Array:
    """Put patches of the given widths into gaps (no gaps at all: into the open surface)."""
    if len(gaps) == 0:
        order = np.argsort(centres)
        left, right = (centres + widths / 2)[order], (centres - widths / 2)[order]
        return np.stack([left, np.append(right[1:], right[0] + 2 * np.pi)], axis=1)
    cuts = []
    for left, right in gaps:
        marks = [left]
        for centre, width in sorted(zip(centres, widths, strict=True)):
            if left < centre < right:
                marks += [centre - width / 2, centre + width / 2]
        marks.append(right)
        cuts += [marks[i : i + 2] for i in range(0, len(marks), 2)]
    return np.array(cuts)
