"""Parts of the method ``grid``: conjugate gradients, edge compliance, relaxation."""

import numpy as np
import pytest

from adhesis import HalfSpace, Problem, self_affine_profile, single_wave
from adhesis.solver.grid import relax
from adhesis.solver.grid.compliance import EdgeCompliance
from adhesis.solver.grid.contact import Contact, ContactSolver
from adhesis.solver.grid.edges import Move, survey
from adhesis.solver.grid.elasticity import ElasticGrid
from adhesis.solver.grid.lattice import Lattice
from adhesis.solver.grid.method import GridMethod
from adhesis.solver.grid.moves import edge_moves, pair_moves
from adhesis.solver.model.control import Control
from tests.support.scenes import HALF_SPACE, grid_of

PERIOD = 2e-3 * np.pi


def rough(gamma: float = 0.02, seed: int = 5, **options) -> GridMethod:
    profile = self_affine_profile(0.8, period=PERIOD, n0=2, ratio=8, seed=seed, h_rms=1e-6)
    return grid_of(Problem(profile, HALF_SPACE, gamma), **{"nodes": 512, **options})


def contact_between(cuts: np.ndarray, n: int) -> np.ndarray:
    """Nodes of the patches that begin and end at these of ``n`` nodes, by turns."""
    mask = np.zeros(n, dtype=bool)
    for a, b in cuts.reshape(-1, 2):
        mask[a:b] = True
    return mask


def dense(kernel: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    return kernel[np.abs(rows[:, None] - columns[None, :])]


def exact_energy(method: GridMethod, mask: np.ndarray, separation: float) -> float:
    """U in J/m by dense linear algebra."""
    nodes = np.flatnonzero(mask)
    target = method.lattice.height[nodes] - separation
    stress = np.linalg.solve(dense(method.lattice.elastic.kernel(), nodes, nodes), target)
    gamma = method.lattice.adhesion[nodes].sum()
    return float(method.lattice.elastic.dx * (0.5 * stress @ target - gamma))


def test_energy_error_is_of_second_order_in_the_residual():
    method = rough()
    rng = np.random.default_rng(0)
    mask = contact_between(np.sort(rng.choice(method.nodes, 8, replace=False)), method.nodes)
    mask = np.roll(mask, rng.integers(method.nodes))
    errors, residuals = [], []
    exact = exact_energy(method, mask, 0.3e-6) + method.lattice.elastic.dx * float(
        method.lattice.adhesion[mask].sum()
    )
    for tolerance in (3.0, 0.3, 0.03):
        contact = method.solver.empty(0.3e-6)
        contact.mask = mask.copy()
        method.solver.solve(contact, tolerance)
        errors.append(exact - contact.elastic_energy)
        residuals.append(contact.residual)
        assert 0 <= errors[-1] <= contact.energy_error  # from below, and bounded
    order = np.polyfit(np.log(residuals), np.log(errors), 1)[0]
    assert order > 1.6


def test_stalled_iteration_is_reported():
    elastic = ElasticGrid(64, 1.0, 1.0)
    solver = ContactSolver(elastic, np.cos(np.arange(64.0)), 1.0, Control())
    contact = Contact(0.1, 0.1, np.ones(64, dtype=bool), np.zeros(64), np.zeros(64))
    # Full contact at a mean gap: no solution exists.
    with pytest.raises(RuntimeError, match="no free node left: contact is full"):
        solver.solve(contact, 1e-12)


def schur(kernel: np.ndarray, nodes: np.ndarray, j: int) -> float:
    row = dense(kernel, np.array([j]), nodes)[0]
    return float(kernel[0] - row @ np.linalg.solve(dense(kernel, nodes, nodes), row))


def test_compliance_agrees_with_the_schur_complement_of_random_contact_sets():
    n = 1024
    lattice = Lattice(Problem(single_wave(1.0, 2.0 * n), HalfSpace(1e6, 0.0), 0.0), n)
    lattice.height = np.zeros(n)
    kernel = lattice.elastic.kernel()
    errors = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        patches = int(rng.integers(2, 7))
        # Half of the sets have short patches and narrow gaps.
        if seed % 2:
            cuts = np.cumsum(rng.integers(1, 24, 2 * patches))
        else:
            cuts = np.sort(rng.choice(n - 1, 2 * patches, replace=False))
        mask = contact_between(cuts, n)
        contact = Contact(1.0, 1.0, mask, -np.ones(n) * mask, np.zeros(n), residual=1.0)
        # Unit gap, unit tension, no adhesion: the prices are S itself.
        edges = survey(contact, lattice)
        for k in range(edges.side.size):
            nodes = np.flatnonzero(mask)
            exact = schur(kernel, nodes, int(edges.outer[k]))
            errors.append(1 / edges.growth[k] / exact - 1)
            rest = nodes[nodes != edges.inner[k]]
            exact = schur(kernel, rest, int(edges.inner[k]))
            errors.append(-edges.recession[k] / exact - 1)
    # The worst are patches of one or two nodes far from all others, which no grid resolves anyway.
    assert np.abs(errors).max() < 1.5e-2
    assert np.median(np.abs(errors)) < 1e-3


@pytest.mark.parametrize("gap", [27, 43, 70, 306, 700])
def test_compliance_of_a_pair_of_edges_where_patches_fill_the_period(gap):
    """Lengths are rounded, up to a few per cent longer than the period that they share."""
    n = 1024
    kernel = ElasticGrid(n, 1.0, 1e6).kernel()
    for near in {(n - gap) // 3 + 1, (n - gap) // 2, n - gap - 2 - (n - gap) // 5}:
        compliance = EdgeCompliance(kernel)
        nodes = np.arange(gap, n)  # both patches, which are one here
        across = dense(kernel, np.array([0, gap - 1]), nodes)
        own = dense(kernel, np.array([0, gap - 1]), np.array([0, gap - 1]))
        exact = own - across @ np.linalg.solve(dense(kernel, nodes, nodes), across.T)
        found = compliance.across_gap(near, gap, n - gap - near)
        assert np.abs(found - exact).max() < 0.05 * exact[0, 0]


def test_a_blocked_move_of_one_edge_blocks_no_pair():
    """Nodes of a pair were taken for side and node of one edge where a patch began at node 1."""
    method = rough()
    contact = method.solver.empty(5e-6)
    contact.mask[1:8] = True
    method.solver.solve(contact, 1e-4)
    edges = survey(contact, method.lattice)
    pair = pair_moves(contact, edges, method.lattice, set(), False)
    assert [(move.edge, move.direction) for move in pair] == [(0, -1), (1, -1)]
    single = edge_moves(edges, method.lattice, 1, {}, set(), 0, False)
    assert {(1, 7, -1)} < {move.key for move in single}
    blocked = {move.key for move in single}
    assert pair_moves(contact, edges, method.lattice, blocked, False) == pair


def settle(method: GridMethod, separation: float) -> tuple[Contact, list[float]]:
    contact = method.solver.empty(separation)
    contact.mask = method.lattice.height > separation
    method.solver.solve(contact, 1e-4)
    energies: list[float] = []

    def watch(energy: float, relaxing: Contact) -> bool:
        energies.append(exact_energy(method, relaxing.mask, separation))
        return False

    relaxed = method.relaxation.relax(contact, watch)
    assert relaxed is not None
    return relaxed, energies


@pytest.mark.parametrize("seed", [5, 6, 7])
@pytest.mark.parametrize("gamma", [0.002, 0.02])
def test_energy_never_rises_in_a_relaxation_and_ends_in_a_local_minimum(seed, gamma):
    method = rough(gamma, seed)
    separation = 0.6e-6
    relaxed, energies = settle(method, separation)
    unit = method.lattice.elastic.dx * gamma
    assert len(energies) > 3
    assert np.diff(energies).max() <= 1e-5 * unit
    lowest = exact_energy(method, relaxed.mask, separation)
    assert lowest <= energies[-1] + 1e-9 * unit
    edges = survey(relaxed, method.lattice)
    for node in {*edges.inner.tolist(), *edges.outer.tolist()}:
        flipped = relaxed.mask.copy()
        flipped[node] ^= True
        if flipped[node] or relaxed.stress[node] < 0:
            # 0.5 %: what S may be wrong by.
            assert exact_energy(method, flipped, separation) > lowest - 0.005 * unit
    gap = relaxed.displacement - method.lattice.height + separation
    assert gap[~relaxed.mask].min() > -1e-12


def test_moves_that_seem_to_pay_by_turns_do_not_go_on_for_ever(monkeypatch):
    # Loosely solved stresses have less energy here than their error says, so that two moves which
    # cost energy seem to pay, until they are solved because the watch would stop there.
    method = rough()
    relaxation = method.relaxation
    at_rest, _ = settle(method, 0.6e-6)
    plain, solve = Lattice.energy, ContactSolver.solve

    def loosely(solver, contact, tolerance):
        solve(solver, contact, tolerance)
        if tolerance > relaxation.tight:
            contact.residual = 2 * relaxation.tight_residual

    def misleading(lattice, contact):
        return plain(lattice, contact) - (contact.residual > relaxation.tight_residual) * 1e-3

    def costly(contact, edges, lattice, blocked, alone):
        left = [k for k in range(2) if (k, k, 1) not in blocked]
        return [Move(k, 1, 1, 1.0, (k, k, 1)) for k in left[:1]]

    monkeypatch.setattr(ContactSolver, "solve", loosely)
    monkeypatch.setattr(Lattice, "energy", misleading)
    monkeypatch.setattr(relax, "edge_moves", lambda *_: [])
    monkeypatch.setattr(relax, "pair_moves", costly)
    monkeypatch.setattr(relax, "_MAX_SWEEPS", 200)
    again = relaxation.relax(at_rest, lambda _, seen: seen.residual > relaxation.tight_residual)
    np.testing.assert_array_equal(again.mask, at_rest.mask)
