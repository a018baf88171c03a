"""Select the moves of edges on a grid that release energy, and apply them to the contact set."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.grid.contact import Contact
from adhesis.solver.grid.edges import Edges, Key, Move
from adhesis.solver.grid.lattice import Lattice
from adhesis.solver.grid.pairs import pairs

# Moves whose energies differ by less than this share of the largest tie: mirror images must move
# together, and rounding must not choose between them.
_TIE = 1e-6
# Least released energy of a move, as a share of γ' dx: smaller ones are within the error of S by
# lumping.
_MARGIN = 1e-4


class Motion(NamedTuple):
    """Direction and length of an edge's last move, and the fraction of a node carried over."""

    direction: int
    length: int
    carried: float


EdgeMotions = dict[tuple[int, int], Motion]
"""Last motion of each edge, by its side and contact node."""


def least_release(lattice: Lattice) -> float:
    """Compute the least energy in J/m that a move must release."""
    return _MARGIN * lattice.dx * float(lattice.adhesion.min())


def edge_moves(
    edges: Edges,
    lattice: Lattice,
    longest: int,
    motions: EdgeMotions,
    blocked: set[Key],
    caution: int,
    equal_speeds: bool,
) -> list[Move]:
    """Select moves of single edges that release energy, fewer with more ``caution``.

    By linear kinetics edges move in proportion to the energy that their next node releases: the
    leading one by its own step, which doubles while it keeps its direction, the others by the
    corresponding share, accumulated to whole nodes. For comparison, with ``equal_speeds``, every
    edge moves by its own step.
    """
    margin = least_release(lattice)
    moves = []
    for k in np.flatnonzero(np.minimum(edges.growth, edges.recession) < -margin).tolist():
        side, inner = int(edges.side[k]), int(edges.inner[k])
        outwards = edges.growth[k] <= edges.recession[k]
        direction = 1 if outwards else -1
        key = (side, inner, direction)
        if key in blocked:
            continue
        before = motions.get((side, inner))
        same = before is not None and before.direction == direction
        length = 2 * before.length if before is not None and same else 1
        available = int(edges.gap[k] if outwards else edges.width[k])
        length = max(1, min(length, longest, available // 3))
        release = -float(edges.growth[k] if outwards else edges.recession[k])
        carried = before.carried if before is not None and same else 0.0
        moves.append(Move(k, direction, length, release, key, carried))
    if not moves:
        return moves
    if caution:
        moves = [m._replace(length=1) for m in moves]
    if caution < 2:
        return moves if equal_speeds else _in_proportion(moves)
    # caution 2, 3, …: the half, quarter, … that releases most energy moves by one node
    keep = max(1, len(moves) >> (caution - 1))
    least = sorted(m.release for m in moves)[-keep] * (1 - _TIE)
    largest = [m for m in moves if m.release >= least]
    if len(moves) >> (caution - 2) > 1:
        return largest
    # Even tied moves together raised the energy: only the first from the highest crest moves.
    return [min(largest, key=lambda m: _position(edges, m.edge, lattice))]


def _in_proportion(moves: list[Move]) -> list[Move]:
    """Scale the moves in proportion to their released energies; the leading one is kept."""
    fastest = max(m.release for m in moves)
    leading = min(m.length for m in moves if m.release >= fastest * (1 - _TIE))
    shared = []
    for m in moves:
        distance = m.carried + leading * m.release / fastest
        # moves that tie in released energy must get equal lengths
        length = min(int(distance + 10 * _TIE * leading), m.length)
        shared.append(m._replace(length=length, carried=min(max(distance - length, 0.0), 1.0)))
    return shared


def pair_moves(
    contact: Contact, edges: Edges, lattice: Lattice, blocked: set[Key], one_pair: bool
) -> list[Move]:
    """Select the moves of the pair of edges that releases most, and of those that tie with it.

    With ``one_pair`` only the first of them from the highest crest.
    """
    margin = least_release(lattice)
    found = pairs(contact, edges, lattice)
    found = [both for both in found if both[0].release > margin and both[0].key not in blocked]
    if not found:
        return []
    most = max(first.release for first, _ in found)
    tied = [both for both in found if both[0].release >= most * (1 - _TIE)]
    if one_pair:
        tied = [min(tied, key=lambda both: _position(edges, both[0].edge, lattice))]
    return [move for both in tied for move in both]


def _position(edges: Edges, edge: int, lattice: Lattice) -> int:
    """Count the nodes from the highest crest to an edge, to the right."""
    return (int(edges.inner[edge]) - lattice.origin) % lattice.n


def apply_moves(contact: Contact, edges: Edges, moves: list[Move]) -> tuple[EdgeMotions, int]:
    """Move the edges; return the motion by edge at its new node, and the number of flips."""
    mask, stress = contact.mask, contact.stress
    n = mask.size
    motions: EdgeMotions = {}
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
        moved = (inner + move.direction * side * length) % n
        motions[(side, moved)] = Motion(move.direction, length, move.carried)
        flips += length
    # The last free node never joins.
    if mask.all():
        joined = next(m.edge for m in moves if m.direction > 0 and m.length)
        mask[edges.outer[joined]] = False
    return motions, flips


def join_overlaps(contact: Contact, edges: Edges, lattice: Lattice, longest: int) -> int:
    """Add overlapping nodes beside the patches, up to the longest step; return their number."""
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
