"""Relaxation of a contact set at fixed separation: edges move until every move would cost energy.

The rules (docs/methods.md):

*   a free node beside a patch that overlaps the rigid profile joins;
*   otherwise edges move by energy comparison; every edge has its own step, doubled while it keeps
    its direction, one node after it turns, never longer than a tenth of the shortest wave;
*   no state is accepted whose energy lies above that of the last admissible state: the sweep is
    taken back and fewer edges move, in the end the most unstable one alone, by one node;
*   contact nucleates where the gap vanishes away from edges, from a relaxed state only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.grid.compliance import EdgeCompliance
from solver.grid.contact import Contact, ContactSolver
from solver.grid.edges import Edges, Indices, survey
from solver.grid.elasticity import ElasticGrid
from solver.grid.pairs import pairs
from solver.profile import Array

# Moves whose energies differ by less than this share of the largest are equally urgent: mirror
# images must move together, and rounding must not choose between them.
_TIE = 1e-6
# A move must release this share of γ' dx: below lies the error of S.
_MARGIN = 1e-4
_MAX_SWEEPS = 1_000_000
_MAX_ACTIVE_SETS = 1000

Abort = Callable[[float, Contact], bool]
"""Called with the energy (J/m) and the contact after each admissible sweep; True stops."""


@dataclass(frozen=True)
class _Move:
    """One edge's move: ``length`` nodes outwards (``direction`` +1) or inwards (-1)."""

    edge: int
    direction: int
    length: int
    release: float
    key: tuple[int, int, int]


class Relaxation:
    """Edge descent on one grid.

    Parameters
    ----------
    elastic : ElasticGrid
    solver : ContactSolver
    adhesion : array, shape (n,)
        γ sqrt(1 + h'²) in J/m².
    longest_step : int
        Longest step of an edge, in nodes.
    loose, tight : float
        Residuals while edges run, and of a relaxed state, in closing gaps.
    """

    def __init__(
        self,
        elastic: ElasticGrid,
        solver: ContactSolver,
        adhesion: Array,
        *,
        longest_step: int,
        loose: float,
        tight: float,
    ) -> None:
        self.elastic = elastic
        self.solver = solver
        self.adhesion = adhesion
        self.compliance = EdgeCompliance(elastic.kernel())
        self.longest_step = longest_step
        self.loose = loose
        self.tight = tight
        self._tight_residual = tight * solver.closing_gap
        self.tie_height = 1e-9 * float(np.abs(solver.height).max())
        self._least_release = 0.1 * _MARGIN * elastic.dx * float(adhesion.min())
        self.sweeps = 0
        self.rejected = 0
        self.flips = 0

    def adhesion_energy(self, contact: Contact) -> float:
        """-Σ γ sqrt(1 + h'²) dx over the contact nodes, in J/m."""
        return -self.elastic.dx * float(np.sum(self.adhesion[contact.mask]))

    def energy(self, contact: Contact) -> float:
        """U in J/m, per period."""
        return contact.elastic_energy + self.adhesion_energy(contact)

    def relax(self, contact: Contact, abort: Abort | None = None) -> Contact | None:
        """Move the edges of ``contact`` (solved) to the nearest local minimum of the energy.

        Returns
        -------
        Contact or None
            A relaxed contact, solved to the tight tolerance; None if ``abort`` said so.
        """
        memory: dict[tuple[int, int], tuple[int, int]] = {}
        blocked: set[tuple[int, int, int]] = set()
        anchor: Contact | None = None
        anchor_energy = np.inf
        caution = 0
        tolerance = self.loose
        tight_energy = np.inf
        moves: list[_Move] = []
        paired = False
        current = contact.copy()
        for _ in range(_MAX_SWEEPS):
            edges = self._survey(current)
            if edges.overlap.any():
                self._join_overlaps(current, edges)
                self.solver.solve(current, tolerance)
                self.sweeps += 1
                continue
            energy = self.energy(current)
            if (
                anchor is not None
                and moves
                and energy >= anchor_energy - current.energy_error
                and current.residual > self._tight_residual
            ):
                # Unsolved stress has too little energy: no decision on it when it is close.
                self.solver.solve(current, self.tight)
                continue
            if anchor is not None and moves and energy >= anchor_energy - self._least_release:
                # The last sweep did not pay: take it back and try fewer edges, shorter steps.
                self.rejected += 1
                if paired:
                    blocked.update(m.key for m in moves)
                elif len(moves) == 1 and moves[0].length == 1:
                    blocked.add(moves[0].key)
                    caution = 1
                else:
                    caution += 1
                current = anchor.copy()
                edges = self._survey(current)
            else:
                if moves:
                    blocked.clear()
                    caution = 0
                if abort is not None and abort(energy, current):
                    return None
                anchor = current.copy()
                anchor_energy = energy
            moves = self._moves(edges, memory, blocked, caution)
            paired = False
            if not moves and current.residual <= self._tight_residual:
                moves = self._pair_moves(current, edges, blocked)
                paired = bool(moves)
            if not moves:
                if current.residual > self._tight_residual:
                    self.solver.solve(current, self.tight)
                    blocked.clear()
                    energy = self.energy(current)
                    if energy >= tight_energy - self._least_release:
                        # Nothing was won since the last time: loosely solved states go in circles.
                        tolerance = self.tight
                    tight_energy = min(energy, tight_energy)
                    continue
                if not self._nucleate(current):
                    return current
                self.solver.solve(current, tolerance)
                anchor = None
                tight_energy = np.inf
                memory.clear()
                blocked.clear()
                continue
            memory = self._apply(current, edges, moves)
            self.solver.solve(current, tolerance)
            self.sweeps += 1
        raise RuntimeError("edges still move after a million sweeps")

    def relax_without_adhesion(self, contact: Contact) -> Contact:
        """Contact without adhesion: no tension, no overlap, one solution at every separation.

        Without adhesion nothing holds the inside of a contact together, so nodes in tension leave
        wherever they are and overlapping nodes join wherever they are, until the set stays
        (primal-dual active set; Hintermüller, Ito & Kunisch, SIAM J. Optim. 13 (2003) 865).

        Raises
        ------
        RuntimeError
            If the contact set does not settle.
        """
        contact = contact.copy()
        for _ in range(_MAX_ACTIVE_SETS):
            self.solver.solve(contact, self.tight)
            self.sweeps += 1
            gap = contact.displacement - self.solver.height + contact.separation
            kept = np.where(contact.mask, contact.stress >= 0, gap < -self._tight_residual)
            changed = int(np.count_nonzero(kept != contact.mask))
            if changed == 0:
                return contact
            self.flips += changed
            contact.mask = kept
        raise RuntimeError("the contact set without adhesion does not settle")

    # ------------------------------------------------------------------ moves

    def _survey(self, contact: Contact) -> Edges:
        return survey(
            contact,
            self.solver.height,
            self.adhesion,
            self.elastic.dx,
            self.compliance,
            -contact.residual,
        )

    def _moves(
        self,
        edges: Edges,
        memory: dict[tuple[int, int], tuple[int, int]],
        blocked: set[tuple[int, int, int]],
        caution: int,
    ) -> list[_Move]:
        """Moves that release energy, thinned out by ``caution``."""
        margin = _MARGIN * self.elastic.dx * float(self.adhesion.min())
        moves = []
        for k in np.flatnonzero(np.minimum(edges.growth, edges.recession) < -margin).tolist():
            side, inner = int(edges.side[k]), int(edges.inner[k])
            outwards = edges.growth[k] <= edges.recession[k]
            direction = 1 if outwards else -1
            key = (side, inner, direction)
            if key in blocked:
                continue
            before, length = memory.get((side, inner), (direction, 0))
            length = 2 * length if before == direction else 1
            room = int(edges.gap[k] if outwards else edges.width[k])
            length = max(1, min(length, self.longest_step, room // 3))
            release = -float(edges.growth[k] if outwards else edges.recession[k])
            moves.append(_Move(k, direction, length, release, key))
        if not caution or not moves:
            return moves
        moves = [_Move(m.edge, m.direction, 1, m.release, m.key) for m in moves]
        # 1: all edges by one node; 2, 3, …: the most unstable half, quarter, …
        keep = max(1, len(moves) >> (caution - 1))
        least = sorted(m.release for m in moves)[-keep] * (1 - _TIE)
        urgent = [m for m in moves if m.release >= least]
        # Even the tied ones together did not pay: one of them, the leftmost.
        return urgent[:1] if caution > 1 and len(moves) >> (caution - 2) <= 1 else urgent

    def _pair_moves(
        self, contact: Contact, edges: Edges, blocked: set[tuple[int, int, int]]
    ) -> list[_Move]:
        """Moves of the pair of edges that releases most, and of those that tie with it."""
        elastic = self.elastic
        margin = _MARGIN * elastic.dx * float(self.adhesion.min())
        found = pairs(
            contact, edges, self.solver.height, self.adhesion, elastic.dx, self.compliance
        )
        found = [p for p in found if p.release > margin and p.key(edges) not in blocked]
        if not found:
            return []
        most = max(p.release for p in found)
        return [
            _Move(edge, p.direction, 1, p.release, p.key(edges))
            for p in found
            if p.release >= most * (1 - _TIE)
            for edge in p.edges
        ]

    def _apply(
        self, contact: Contact, edges: Edges, moves: list[_Move]
    ) -> dict[tuple[int, int], tuple[int, int]]:
        """Move the edges; return each one's direction and step under its new place."""
        n = self.elastic.n
        mask, stress = contact.mask, contact.stress
        memory: dict[tuple[int, int], tuple[int, int]] = {}
        for move in moves:
            side = int(edges.side[move.edge])
            inner = int(edges.inner[move.edge])
            if move.direction > 0:
                nodes = (inner + side * np.arange(1, move.length + 1)) % n
                mask[nodes] = True
                length = move.length
            else:
                nodes = (inner - side * np.arange(move.length)) % n
                # A node under compression is never removed.
                length = int(np.argmin(np.append(stress[nodes] < 0, False)))
                mask[nodes[:length]] = False
            memory[(side, (inner + move.direction * side * length) % n)] = (
                move.direction,
                length,
            )
            self.flips += length
        # The last free node never joins.
        if mask.all():
            mask[edges.outer[moves[0].edge]] = False
        return memory

    def _join_overlaps(self, contact: Contact, edges: Edges) -> None:
        """Add the overlapping nodes beside the patches, up to the longest step from each edge."""
        n = self.elastic.n
        gap = contact.displacement - self.solver.height + contact.separation
        for k in np.flatnonzero(edges.overlap).tolist():
            nodes = (edges.outer[k] + edges.side[k] * np.arange(self.longest_step)) % n
            joined = nodes[: int(np.argmin(np.append(gap[nodes] < 0, False)))]
            contact.mask[joined] = True
            self.flips += joined.size
        if contact.mask.all():
            contact.mask[edges.outer[0]] = False

    # ------------------------------------------------------------------ nucleation

    def touching(self, contact: Contact) -> Indices:
        """Nodes away from every edge where the surfaces touch first; empty if they do not.

        The gap between nodes is a parabola through three of them, so that first touch comes when
        the surfaces touch and not when nodes do. Places that overlap equally touch together.
        """
        gap = contact.displacement - self.solver.height + contact.separation
        left, right = np.roll(gap, 1), np.roll(gap, -1)
        free = ~contact.mask
        free &= np.roll(free, 1) & np.roll(free, -1)
        bend = left + right - 2 * gap
        crest = free & (gap <= left) & (gap <= right) & (bend > 0)
        least = np.where(crest, gap - (right - left) ** 2 / np.where(crest, 8 * bend, 1.0), np.inf)
        lowest = float(least.min())
        if lowest > 0:
            return np.empty(0, dtype=np.intp)
        tied = np.flatnonzero(least <= lowest + self.tie_height)
        # A crest halfway between two nodes must not nucleate twice.
        return tied[np.diff(tied, prepend=tied[-1] - self.elastic.n) > 1]

    def _nucleate(self, contact: Contact) -> bool:
        nodes = self.touching(contact)
        if nodes.size == 0:
            return False
        gap = contact.displacement[nodes] - self.solver.height[nodes] + contact.separation
        cost = 0.5 * np.maximum(gap, 0.0) ** 2 / self.compliance(0, self.elastic.n, None)
        nodes = nodes[cost < self.adhesion[nodes]]
        contact.mask[nodes] = True
        self.flips += nodes.size
        return bool(nodes.size)


def ranges_mask(n: int, first: Indices, width: Indices) -> NDArray[np.bool_]:
    """Contact set of n nodes from the patches' first nodes and widths."""
    mask = np.zeros(n, dtype=bool)
    for a, w in zip(first.tolist(), width.tolist(), strict=True):
        mask[np.arange(a, a + w) % n] = True
    return mask
