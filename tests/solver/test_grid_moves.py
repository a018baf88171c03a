"""Moves of edges on a grid: in proportion, who leads, no node under compression removed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adhesis import Problem, single_wave
from adhesis.solver.grid.contact import Contact
from adhesis.solver.grid.edges import Edges
from adhesis.solver.grid.kernels import patch_ranges
from adhesis.solver.grid.lattice import Lattice
from adhesis.solver.grid.moves import Motion, apply_moves, edge_moves, least_release
from tests.support.scenes import HALF_SPACE

N = 256
WAVE = Problem(single_wave(1e-6, 1e-3), HALF_SPACE, 0.01)


def edges_of(mask: np.ndarray, releases: list[float], direction: int) -> Edges:
    """Edges of a contact set that release so much by moving outwards (1) or inwards (-1)."""
    first, width = patch_ranges(mask)
    last = first + width - 1
    count = first.size
    side = np.repeat(np.array([-1, 1], dtype=np.intp), count)
    inner = np.concatenate((first, last)) % N
    price, ruled_out = -np.array(releases), np.full(2 * count, np.inf)
    grow, recede = (price, ruled_out) if direction > 0 else (ruled_out, price)
    far = np.full(2 * count, 90, dtype=np.intp)
    nowhere = np.zeros(2 * count, dtype=bool)
    return Edges(side, inner, (inner + side) % N, far, far, grow, recede, nowhere)


@pytest.fixture
def lattice() -> Lattice:
    return replace(Lattice.of(WAVE, N), origin=100)


def two_patches() -> np.ndarray:
    mask = np.zeros(N, dtype=bool)
    mask[20:41] = mask[150:171] = True
    return mask


def test_edges_move_in_proportion_to_what_they_release(lattice: Lattice) -> None:
    """The leading edge by its own step, 8 nodes; one that releases a quarter of it by two."""
    unit = 1e3 * least_release(lattice)
    edges = edges_of(two_patches(), [4 * unit, unit, 2 * unit, 0.1 * unit], 1)
    first = edge_moves(edges, lattice, 8, {}, set(), 0, False)
    assert [(m.edge, m.length, round(m.carried, 6)) for m in first] == [
        (0, 1, 0.0),
        (1, 0, 0.25),
        (2, 0, 0.5),
        (3, 0, 0.025),
    ]
    assert [m.length for m in edge_moves(edges, lattice, 8, {}, set(), 0, True)] == [1] * 4
    memory = {
        (int(edges.side[m.edge]), int(edges.inner[m.edge])): Motion(1, 4, m.carried) for m in first
    }
    then = edge_moves(edges, lattice, 8, memory, set(), 0, False)
    assert [(m.edge, m.length, round(m.carried, 6)) for m in then] == [
        (0, 8, 0.0),
        (1, 2, 0.25),
        (2, 4, 0.5),
        (3, 0, 0.225),
    ]


def test_of_equally_urgent_edges_the_first_from_the_highest_crest_on_leads(
    lattice: Lattice,
) -> None:
    unit = 1e3 * least_release(lattice)
    edges = edges_of(two_patches(), [unit] * 4, 1)
    # Left edges at 20 and 150, right ones at 40 and 170; the crest lies at node 100.
    (leader,) = edge_moves(edges, lattice, 8, {}, set(), 4, False)
    assert int(edges.inner[leader.edge]) == 150
    (leader,) = edge_moves(edges, replace(lattice, origin=160), 8, {}, set(), 4, False)
    assert int(edges.inner[leader.edge]) == 170


def test_a_node_under_compression_is_never_removed(lattice: Lattice) -> None:
    mask = two_patches()
    stress = np.where(mask, -1.0, 0.0)
    stress[22] = stress[168] = 1.0  # the third node from the left edge, and from the right one
    contact = Contact(0.0, 0.0, mask, stress, np.zeros(N))
    unit = 1e3 * least_release(lattice)
    edges = edges_of(mask, [unit] * 4, -1)
    moves = [m._replace(length=5) for m in edge_moves(edges, lattice, 8, {}, set(), 0, True)]
    _, flips = apply_moves(contact, edges, moves)
    assert np.flatnonzero(contact.mask).tolist() == [*range(22, 36), *range(155, 169)]
    assert flips == 2 + 5 + 5 + 2
