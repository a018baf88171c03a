"""Relax a contact set at a fixed prescribed value: edges move until no move releases energy.

A state is rejected if its energy exceeds that of the last admissible state: the sweep is undone
and fewer edges move, finally only the most unstable one, by one node (docs/methods.md).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adhesis.solver.grid.contact import EDGE_COMPLIANCE, Contact, ContactSolver
from adhesis.solver.grid.edges import Edges, Indices, Key, Move, survey
from adhesis.solver.grid.lattice import Lattice
from adhesis.solver.grid.moves import (
    EdgeMotions,
    apply_moves,
    edge_moves,
    join_overlaps,
    least_release,
    pair_moves,
)
from adhesis.solver.method import PathError
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import EQUAL_CRESTS, first_of_equal

_LOOSE = 0.02  # closing gaps: tolerance of the residual while edges move
_MAX_SWEEPS = 1_000_000
_MAX_ACTIVE_SETS = 1000

Abort = Callable[[float, Contact], bool]
"""Called with the energy (J/m) and the contact after each admissible sweep; True stops."""


# Nodes: how far the lowest nodes of equal minima may be from where these are alike.
_SAME_NODE = 2.0


class Relaxation:
    """Edge descent on a grid of ``nodes`` nodes of one problem.

    Attributes
    ----------
    longest_step : int
        Largest step of an edge, in nodes.
    tight : float
        Tolerance of the residual of a relaxed state, in closing gaps.
    """

    tight = 1e-4

    def __init__(self, problem: Problem, nodes: int) -> None:
        self.lattice = lattice = Lattice(problem, nodes)
        # The largest gap that adhesion closes beside an edge, at least the height of a crest of rms
        # curvature within half a node.
        modulus, curvature = problem.half_space.modulus, float(np.sqrt(problem.profile.m4))
        closing = 2 * problem.work_of_adhesion * EDGE_COMPLIANCE * lattice.dx / modulus
        closing_gap = max(float(np.sqrt(closing)), 0.125 * lattice.dx**2 * curvature)
        self.solver = ContactSolver(lattice.elastic, lattice.height, closing_gap, problem.control)
        self.longest_step = max(1, int(0.1 * problem.shortest_wavelength / lattice.dx))
        self.tight_residual = self.tight * closing_gap
        self.tie_height = EQUAL_CRESTS * float(np.abs(lattice.height).max())
        # smaller falls of the energy are within the error of S
        self.least_fall = 0.1 * least_release(lattice)
        self.sweeps = 0
        self.flips = 0

    def relax(
        self, contact: Contact, abort: Abort | None = None, *, equal_speeds: bool = False
    ) -> Contact | None:
        """Move the edges of ``contact`` (solved) to the local minimum reached by descent.

        Descent follows linear kinetics, or with ``equal_speeds`` the alternative kinetics. The
        contact is solved to the tight tolerance; None if ``abort`` returned True.

        Raises
        ------
        PathError
            If the descent does not converge.
        """
        return _Descent(self, contact, abort, equal_speeds).run()

    def relax_without_adhesion(self, contact: Contact) -> Contact:
        """Solve contact without adhesion: no tension, no overlap, a unique solution.

        Nodes in tension leave and overlapping nodes join, inside patches as well, until the set
        does not change (primal-dual active set; Hintermüller, Ito & Kunisch, SIAM J. Optim. 13
        (2003) 865).

        Raises
        ------
        PathError
            If the contact set does not converge.
        """
        contact = contact.copy()
        if self.solver.control.is_load:
            if contact.prescribed >= 0:  # no load, or a tension, at which the solid has fallen off
                apart = self.solver.empty(self.lattice.h_max)
                apart.prescribed = contact.prescribed
                return apart
            if not contact.mask.any():  # the load is carried by some nodes: those in tension leave
                contact.mask = self.lattice.height > self.lattice.height.min()
        for _ in range(_MAX_ACTIVE_SETS):
            self.solver.solve(contact, self.tight)
            self.sweeps += 1
            gap = self.lattice.gap(contact)
            kept = np.where(contact.mask, contact.stress >= 0, gap < -self.tight_residual)
            changed = int(np.count_nonzero(kept != contact.mask))
            if changed == 0:
                return contact
            self.flips += changed
            contact.mask = kept
        raise PathError(
            f"method 'grid' finds no contact set without adhesion at a mean gap of "
            f"{contact.separation:.6g} m; the method 'sharp', or other nodes, may"
        )

    def touching(self, contact: Contact) -> Indices:
        """Find the nodes away from all edges where the surfaces touch first; empty if none.

        The gap between nodes is a parabola through three of them, so that first touch is located
        between nodes. Of minima of equal gap one is chosen, with its copies
        (:func:`first_of_equal`).
        """
        gap = self.lattice.gap(contact)
        steps = np.diff(gap, append=gap[:1])
        crests = np.flatnonzero(~contact.mask & (steps >= 0) & (np.roll(steps, 1) <= 0))
        left, right = crests - 1, (crests + 1) % gap.size
        bend = gap[left] + gap[right] - 2 * gap[crests]
        inside = ~(contact.mask[left] | contact.mask[right]) & (bend > 0)
        crests, left, right, bend = crests[inside], left[inside], right[inside], bend[inside]
        least = gap[crests] - (gap[right] - gap[left]) ** 2 / (8 * bend)
        lowest = float(least.min(initial=np.inf))
        if lowest > 0:
            return np.empty(0, dtype=np.intp)
        tied = crests[least <= lowest + self.tie_height]
        # A crest halfway between two nodes must nucleate only once.
        tied = tied[np.diff(tied, prepend=tied[-1] - self.lattice.n) > 1]
        lattice = self.lattice
        part = lattice.n / lattice.equal_parts
        return tied[first_of_equal(tied.astype(float), lattice.origin, part, lattice.n, _SAME_NODE)]

    def nucleate(self, contact: Contact) -> bool:
        """Add the nodes where the surfaces touch; returns True if there are any."""
        nodes = self.touching(contact)
        lattice = self.lattice
        gap = lattice.gap(contact, nodes)
        cost = 0.5 * np.maximum(gap, 0.0) ** 2 / lattice.compliance(0, lattice.n, None)
        nodes = nodes[cost < lattice.adhesion[nodes]]
        contact.mask[nodes] = True
        self.flips += nodes.size
        return bool(nodes.size)


class _Descent:
    """State of one relaxation: present contact, last admissible one, and moves tried from it.

    Attributes
    ----------
    caution : int
        0: all edges move by their own steps; 1: by one node; k ≥ 2: only the share 2^(1-k) of them
        that releases most energy.
    """

    def __init__(
        self, rules: Relaxation, contact: Contact, abort: Abort | None, equal_speeds: bool
    ) -> None:
        self.rules = rules
        self.equal_speeds = equal_speeds
        self.lattice, self.solver = rules.lattice, rules.solver
        self.abort = abort
        self.current = contact.copy()
        self.anchor: Contact | None = None
        self.anchor_energy = np.inf
        self.tight_energy = np.inf
        self.tolerance = _LOOSE
        self.motions: EdgeMotions = {}
        self.blocked: set[Key] = set()
        self.caution = 0
        self.moves: list[Move] = []
        self.paired = False  # the last moves are those of pairs of edges
        self.one_pair = False  # only one of several tied pairs moves

    def run(self) -> Contact | None:
        for _ in range(_MAX_SWEEPS):
            edges = survey(self.current, self.lattice)
            if edges.overlap.any():
                longest = self.rules.longest_step
                self.rules.flips += join_overlaps(self.current, edges, self.lattice, longest)
                self._sweep()
                continue
            energy = self.lattice.energy(self.current)
            if self._is_undecided(energy):
                # An unconverged stress underestimates the energy: close decisions need a solution.
                self.solver.solve(self.current, self.rules.tight)
                continue
            if self._has_fallen(energy):
                if self.abort is not None and self.abort(energy, self.current):
                    if self._is_tight():
                        return None
                    # Energy and mean stress of a loosely solved stress are too inaccurate for this.
                    # Rejected moves stay blocked until the fall of the energy is confirmed, or two
                    # moves that both seem to release energy would be tried in turn for ever.
                    self.solver.solve(self.current, self.rules.tight)
                    continue
                if self.moves:
                    self.blocked.clear()
                    self.caution = 0
                    self.one_pair = False
                self.anchor = self.current.copy()
                self.anchor_energy = energy
            else:
                self._undo()
                edges = survey(self.current, self.lattice)
            if self._move(edges):
                self._sweep()
            elif self._has_converged():
                return self.current
        raise PathError(
            f"method 'grid' finds no state at a mean gap of {self.current.separation:.6g} m: edges "
            f"still move after {_MAX_SWEEPS} sweeps; the method 'sharp', or other nodes, may"
        )

    def _sweep(self) -> None:
        self.solver.solve(self.current, self.tolerance)
        self.rules.sweeps += 1

    def _is_tight(self) -> bool:
        return not self.current.residual > self.rules.tight_residual

    def _is_undecided(self, energy: float) -> bool:
        """Return True if the change of energy in the last sweep is within its error."""
        if self.anchor is None or not self.moves:
            return False
        return energy >= self.anchor_energy - self.current.energy_error and not self._is_tight()

    def _has_fallen(self, energy: float) -> bool:
        """Return True if the energy fell in the last sweep, or if there was none."""
        if self.anchor is None or not self.moves:
            return True
        return not energy >= self.anchor_energy - self.rules.least_fall

    def _undo(self) -> None:
        """Undo the last sweep and choose fewer edges or shorter steps for the next one."""
        assert self.anchor is not None
        if self.paired and len(self.moves) > 2:
            # Tied pairs impede each other: only one of them moves.
            self.one_pair = True
        elif self.paired:
            self.blocked.update(m.key for m in self.moves)
        elif len(self.moves) == 1 and self.moves[0].length == 1:
            self.blocked.add(self.moves[0].key)
            self.caution = 1
        else:
            self.caution += 1
        self.current = self.anchor.copy()

    def _move(self, edges: Edges) -> bool:
        """Move single edges, or pairs if no single edge releases energy; False if none moves."""
        self.moves = edge_moves(
            edges,
            self.lattice,
            self.rules.longest_step,
            self.motions,
            self.blocked,
            self.caution,
            self.equal_speeds,
        )
        self.paired = False
        if not self.moves and self._is_tight():
            self.moves = pair_moves(self.current, edges, self.lattice, self.blocked, self.one_pair)
            self.paired = bool(self.moves)
        if not self.moves:
            return False
        self.motions, flips = apply_moves(self.current, edges, self.moves)
        self.rules.flips += flips
        return True

    def _has_converged(self) -> bool:
        """Return True at a minimum: edges at rest, tightly solved, and no new touch."""
        if not self._is_tight():
            self.solver.solve(self.current, self.rules.tight)
            self.blocked.clear()
            energy = self.lattice.energy(self.current)
            if energy >= self.tight_energy - self.rules.least_fall:
                # The energy has not fallen since the last tight solution: loose ones would cycle.
                self.tolerance = self.rules.tight
            self.tight_energy = min(energy, self.tight_energy)
            return False
        if not self.rules.nucleate(self.current):
            return True
        self.solver.solve(self.current, self.tolerance)
        self.anchor = None
        self.tight_energy = np.inf
        self.motions.clear()
        self.blocked.clear()
        return False
