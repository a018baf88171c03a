"""Method sharp, given edges: the field against closed forms, another solution, and differences."""

import numpy as np
import pytest

from adhesis import Problem, single_wave
from adhesis.solver._kernels import FieldModel, LoadingDevice, solve_field
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.mechanics import FIXED_SEPARATION
from tests.support import scenes
from tests.support.dense import solve_densely
from tests.support.explicit_solution import explicit_openings, explicit_solution
from tests.support.scenes import HALF_SPACE, grid_of

PERIOD = 2e-3 * np.pi
GAPS = np.array([[0.3, 0.8], [0.83, 2.0], [2.05, 3.1], [3.3, 4.1], [4.2, 6.5]])
SMOOTH = scenes.rough(4, 5, 2, period=PERIOD)
ROUGH = scenes.of_paper(1)  # with wave numbers 10 … 1000
SOURCE, SEPARATION = StressSource(ROUGH), 0.5 * ROUGH.h_max * ROUGH.q0

MOST_NODES = 36  # the order of the rule with the most nodes, 128


def solved_field(source, gaps, prescribed, tolerance, device=FIXED_SEPARATION) -> GapField:
    model = FieldModel(device, float(-np.log(tolerance)), source.panels)
    return GapField(source, gaps, prescribed, lambda: solve_field(gaps, prescribed, model))


def energy(source, gaps, separation):
    """Elastic energy beyond full contact in units of E*/(2 q0²)."""
    field = solved_field(source, gaps, separation, 1e-12)
    return 0.5 * field.solution.work_of_gaps() - np.pi * separation * field.solution.pressure, field


@pytest.mark.parametrize("half_width", [0.01, 0.1, 0.5, 1.5, 3.0])
@pytest.mark.parametrize("toughness", [0.0, 1e-3])
def test_single_wave_against_johnson(half_width, toughness):
    """A cos θ, |θ| < a in contact, any K: mean stress and K to 1e-12 of the wave's p*."""
    amplitude = 1e-3
    source = StressSource(single_wave(amplitude, 2 * np.pi))
    y = np.sin(half_width / 2) ** 2
    p1 = toughness / np.sqrt(2 * np.pi / np.tan(half_width / 2))
    separation = amplitude * (1 - y + y * np.log(y)) - p1 * np.log(y)
    field = solved_field(
        source, np.array([[half_width, 2 * np.pi - half_width]]), separation, 1e-14
    )
    mean_stress = amplitude * y - p1  # E*/2 = 1
    assert abs(field.solution.pressure - mean_stress) < 5e-12 * amplitude
    k = 0.5 * np.sqrt(2 * np.pi) * field.edge_opening
    assert np.abs(k - toughness).max() < 1e-11 * max(toughness, amplitude)


@pytest.mark.parametrize("patches", [1, 3, 4])
def test_field_equals_the_explicit_solution(patches):
    """Cracks in a full contact and the Riemann-Hilbert formula are two ways to the same field.

    They give the same gap everywhere, the latter from profile and edges alone.
    """
    source, separation = StressSource(SMOOTH), 0.6 * SMOOTH.h_max * SMOOTH.q0
    gaps = {
        1: [[1.0, 5.5]],
        3: [[0.3, 0.8], [1.0, 2.0], [2.3, 5.1]],
        4: [[0.3, 0.8], [1.0, 2.0], [2.3, 3.1], [3.3, 4.9]],
    }[patches]
    gaps = np.array(gaps)
    field = solved_field(source, gaps, separation, 1e-13)
    c, opening = explicit_solution(source.panels.stress, gaps, separation, 60)
    assert np.abs(field.edge_opening - opening).max() < 1e-11 * np.abs(opening).max()
    # p̄ = ±c_0 up to the factors 2 of the scaled product T
    assert abs(abs(c[0]) / 2**patches / abs(field.solution.pressure) - 1) < 1e-10
    theta, opening = explicit_openings(SMOOTH, gaps, separation)
    for k in range(patches):
        inside = field.solution.sum_modes(k, theta[k, 1:-1], field.fine_opening(k).modes)
        assert np.abs(inside - opening[k, 1:-1]).max() < 1e-10 * np.abs(opening).max()


def test_a_narrow_gap_of_many_modes_opens_as_one_of_few():
    """There are sine nodes for all modes; fewer were written beyond the end of their arrays."""
    gaps = np.array([[0.3, 0.302], [1.0, 2.0]])
    digits = -np.log(1e-8)
    openings = []
    model = FieldModel(FIXED_SEPARATION, digits, SOURCE.panels)
    for least in (0, MOST_NODES):
        chosen = solve_field(gaps, SEPARATION, model).orders
        solution = solve_field(gaps, SEPARATION, model, np.maximum(chosen, least))
        field = GapField(SOURCE, gaps, SEPARATION, lambda of=solution: of)
        shape = field.fine_opening(0)
        assert len(shape.theta) >= solution.offset[1]
        openings.append(np.interp(gaps[0].mean(), shape.theta, shape.opening))
    assert openings[1] == pytest.approx(openings[0], rel=1e-3)
    assert solution.offset[1] == 128


def test_field_converges_with_its_tolerance():
    """The error follows the tolerance over six decades, with patches down to 0.16 λ_min."""
    gaps = GAPS.copy()
    gaps[1, 0] = 0.801
    exact = solved_field(SOURCE, gaps, SEPARATION, 1e-13).edge_opening
    for tolerance in (1e-3, 1e-5, 1e-7, 1e-9):
        opening = solved_field(SOURCE, gaps, SEPARATION, tolerance).edge_opening
        assert np.abs(opening - exact).max() < 20 * tolerance * np.abs(exact).max()


def test_energy_by_separation_is_the_mean_stress():
    step = 1e-3 * SEPARATION
    slope = (
        energy(SOURCE, GAPS, SEPARATION + step)[0] - energy(SOURCE, GAPS, SEPARATION - step)[0]
    ) / (2 * step)
    pressure = energy(SOURCE, GAPS, SEPARATION)[1].solution.pressure
    assert abs(slope / (-2 * np.pi * pressure) - 1) < 1e-10


def test_energy_by_edge_is_the_energy_release_rate():
    """∂U/∂θ_e = ∓π C²/8: Irwin's G = K²/(2E*) in these units."""
    field = energy(SOURCE, GAPS, SEPARATION)[1]
    scale = np.pi * np.max(field.edge_opening**2) / 8
    for k, side in np.ndindex(5, 2):
        up, down = GAPS.copy(), GAPS.copy()
        up[k, side] += 1e-5
        down[k, side] -= 1e-5
        slope = (energy(SOURCE, up, SEPARATION)[0] - energy(SOURCE, down, SEPARATION)[0]) / 2e-5
        release = np.pi * field.edge_opening[k, side] ** 2 / 8
        assert abs(slope - (-release if side else release)) < 2e-5 * scale


DEVICES = {
    "separation": FIXED_SEPARATION,
    "stiffness": LoadingDevice(1.0, 0.7),
    "load": LoadingDevice(0.0, 1.0),
}


@pytest.mark.parametrize("name", DEVICES)
def test_field_and_derivatives_do_not_know_what_holds_them(name):
    """Held so that it is the one that the gaps have at the separation."""
    fixed, device = solved_field(SOURCE, GAPS, SEPARATION, 1e-13), DEVICES[name]
    prescribed = device.separation_weight * SEPARATION - device.compliance * fixed.solution.pressure
    field = solved_field(SOURCE, GAPS, prescribed, 1e-13, device)
    assert field.solution.separation == pytest.approx(SEPARATION, rel=1e-9)
    assert field.solution.pressure == pytest.approx(fixed.solution.pressure, rel=1e-11)
    assert np.allclose(field.edge_opening, fixed.edge_opening, rtol=1e-9)
    way = 0.5 * SEPARATION
    other = solved_field(SOURCE, GAPS, prescribed + way, 1e-13, device)
    pressure, _, opening = field.solution.by_prescribed()
    change = other.solution.edge_opening - field.solution.edge_opening
    assert np.allclose(change, way * opening, rtol=1e-8)
    rise = other.solution.pressure - field.solution.pressure
    assert abs(rise - way * pressure) < 1e-8 * abs(field.solution.pressure)


def test_edge_opening_against_the_edge_stress_of_the_grid():
    """K of four patches on the grid: first order in dx, and the constant of its edge node.

    The stress of a patch's last node is 0.7602 K/sqrt(dx), and the edge lies 0.190 dx inside the
    outer face of that node (docs/methods.md).
    """
    profile = scenes.rough(2, 8, 2, period=PERIOD)
    source, half_space = StressSource(profile), HALF_SPACE
    separation = 0.3 * profile.h_max
    wanted = np.array([[0.4, 1.5], [2.0, 2.9], [3.3, 4.6], [5.1, 5.9]])  # patches
    errors = []
    for n in (4096, 16384):
        grid = grid_of(Problem(profile, half_space, 0.02), nodes=n)
        first, last = np.round(wanted * n / (2 * np.pi)).astype(int).T
        contact = grid.solver.empty(separation)
        for a, b in zip(first, last, strict=True):
            contact.mask[a : b + 1] = True
        grid.solver.solve(contact, 1e-10)
        dx = profile.period / n
        k_grid = -contact.stress[np.stack([first, last])] * np.sqrt(dx) / 0.7602
        left, right = ((first - 0.31) * 2 * np.pi / n, (last + 0.31) * 2 * np.pi / n)
        gaps = np.stack([right, np.append(left[1:], left[0] + 2 * np.pi)], axis=1)
        opening = solved_field(source, gaps, separation * profile.q0, 1e-10).edge_opening
        # of a gap's ends the left one belongs to the patch before it
        by_patch = np.stack([np.roll(opening[:, 1], 1), opening[:, 0]])
        k = by_patch * half_space.modulus / 4 * np.sqrt(2 * np.pi / profile.q0)
        errors.append(float(np.abs(k_grid - k).max() / np.abs(k).max()))
    assert errors[0] < 0.02
    # four times the nodes: a quarter of the error, but for the four digits of the constants
    assert errors[1] < 0.4 * errors[0] + 2e-4


@pytest.mark.parametrize("order", range(MOST_NODES + 1))
def test_a_gap_is_solved_by_the_inverse_of_its_block_at_every_order(order):
    """Of 4 to 128 nodes."""
    model = FieldModel(FIXED_SEPARATION, 20.0, StressSource(SMOOTH).panels)
    gaps, separation = np.array([[1.0, 5.5]]), 0.6 * SMOOTH.h_max * SMOOTH.q0
    field = solve_field(gaps, separation, model, np.array([order]))
    dense = solve_densely(gaps, separation, model, np.array([order]))
    assert field.pressure == pytest.approx(dense.pressure, rel=1e-11)
    scale = np.abs(dense.edge_opening).max()
    assert np.abs(field.edge_opening - dense.edge_opening).max() < 1e-11 * scale


@pytest.mark.parametrize("k", range(3))
def test_openings_at_fine_nodes_are_sums_of_their_modes(k):
    """Of fifty numbers of nodes, from few to many."""
    profile = scenes.rough(4, 25, 2, period=PERIOD)
    model = FieldModel(FIXED_SEPARATION, 20.0, StressSource(profile).panels)
    gaps = np.array([[0.3, 0.8], [1.0, 2.0], [2.3, 5.1]])
    field = solve_field(gaps, 0.5 * profile.h_max * profile.q0, model)
    for per_wave in np.geomspace(0.1, 15, 50):
        theta, opening, _, modes = field.fine_opening(k, per_wave)
        assert len(opening) == len(modes) == len(theta)
        exact = field.sum_modes(k, theta, modes)
        np.testing.assert_allclose(opening, exact, atol=1e-12 * np.abs(exact).max())


def test_gaps_without_a_field_have_no_opening():
    field = solve_field(GAPS[::-1], SEPARATION, FieldModel(FIXED_SEPARATION, 10.0, SOURCE.panels))
    assert np.isnan(field.pressure)
    with pytest.raises(ValueError, match="there is no field"):
        field.fine_opening(0, 6.0)
