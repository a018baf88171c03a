"""Moves of edges on a grid: which release energy, which go together, and how a set takes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.grid.contact import Contact
from solver.grid.edges import Edges
from solver.grid.lattice import Lattice
from solver.grid.pairs import pairs

# Moves whose energies differ by less than this share of the largest are equally urgent: mirror
# images must move together, and rounding must not choose between them.
_TIE = 1e-6
# A move must release this share of γ' dx: below lies the error of S.
_MARGIN = 1e-4

Key = tuple[int, int, int]
"""Name of a move of a contact set."""
Memory = dict[tuple[int, int], tuple[int, int]]
"""Direction and length of the last move of the edge with this side and contact node."""


@dataclass(frozen=True)
class Move:
    """One edge's move: ``length`` nodes outwards (``direction`` +1) or inwards (-1)."""

    edge: int
    direction: int
    length: int
    release: float
    key: Key


def least_release(lattice: Lattice) -> float:
    """Energy in J/m that a move must release."""
    return _MARGIN * lattice.dx * float(lattice.adhesion.min())


def edge_moves(
    edges: Edges, lattice: Lattice, longest: int, memory: Memory, blocked: set[Key], caution: int
) -> list[Move]:
    """Moves of single edges that release energy, thinned out by ``caution``."""
    margin = least_release(lattice)
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
        length = max(1, min(length, longest, room // 3))
        release = -float(edges.growth[k] if outwards else edges.recession[k])
        moves.append(Move(k, direction, length, release, key))
    if not caution or not moves:
        return moves
    moves = [Move(m.edge, m.direction, 1, m.release, m.key) for m in moves]
    # 1: all edges by one node; 2, 3, …: the most unstable half, quarter, …
    keep = max(1, len(moves) >> (caution - 1))
    least = sorted(m.release for m in moves)[-keep] * (1 - _TIE)
    urgent = [m for m in moves if m.release >= least]
    # Even the tied ones together did not pay: one of them, the leftmost.
    return urgent[:1] if caution > 1 and len(moves) >> (caution - 2) <= 1 else urgent


def pair_moves(contact: Contact, edges: Edges, lattice: Lattice, blocked: set[Key]) -> list[Move]:
    """Moves of the pair of edges that releases most, and of those that tie with it."""
    margin = least_release(lattice)
    found = pairs(contact, edges, lattice)
    found = [p for p in found if p.release > margin and p.key(edges) not in blocked]
    if not found:
        return []
    most = max(p.release for p in found)
    return [
        Move(edge, p.direction, 1, p.release, p.key(edges))
        for p in found
        if p.release >= most * (1 - _TIE)
        for edge in p.edges
    ]


def apply_moves(contact: Contact, edges: Edges, moves: list[Move]) -> tuple[Memory, int]:
    """Move the edges; return each one's direction and step under its new place, and the flips."""
    mask, stress = contact.mask, contact.stress
    n = mask.size
    memory: Memory = {}
    flips = 0
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
        memory[(side, (inner + move.direction * side * length) % n)] = (move.direction, length)
        flips += length
    # The last free node never joins.
    if mask.all():
        mask[edges.outer[moves[0].edge]] = False
    return memory, flips


def join_overlaps(contact: Contact, edges: Edges, lattice: Lattice, longest: int) -> int:
    """Add the overlapping nodes beside the patches, up to the longest step from each edge.

    Returns how many.
    """
    gap = lattice.gap(contact)
    flips = 0
    for k in np.flatnonzero(edges.overlap).tolist():
        nodes = (edges.outer[k] + edges.side[k] * np.arange(longest)) % lattice.n
        joined = nodes[: int(np.argmin(np.append(gap[nodes] < 0, False)))]
        contact.mask[joined] = True
        flips += joined.size
    if contact.mask.all():
        contact.mask[edges.outer[0]] = False
    return flips
