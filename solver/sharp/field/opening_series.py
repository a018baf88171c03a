"""Compute openings at fine nodes, and the energy of a gap field: all modes, by sine transforms.

A gap's opening is T = Σ_n b_n sin((n+1)t), cos t = η. Below the M modes of (1) in ``gap_field``
b_n come from f; above them the straight crack gives b_n = -s_n/(n+1), with s_n the Chebyshev
moments of S_full over the gap. With p = 2p̄/E* the elastic energy of one period is

    U = (E*/(2 q0²)) · ½ [∫ S_full h~ dθ + ∫_gaps S_full T dθ - 2π q0 s p],      h~ = q0 h,

which follows from Betti's theorem; the first term is the energy of full contact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled, compiled_for_both
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.field.solution import Nodes
from adhesis.solver.sharp.gap.conformal_map import (
    eta_at,
    place_nodes,
    theta_at,
)
from adhesis.solver.sharp.gap.full_contact_stress import Panels, interpolate
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, GaussRules
from adhesis.solver.sharp.gap.sine_transform import Circle, sine_sums, tabulate_circle
from adhesis.solver.sharp.tolerances import ENERGY_NODES, FEWEST_SINE_NODES, SHAPE_NODES

_MANY_NODES = 500  # from so many on, sizes of the transform lie closer to each other


@dataclass(frozen=True)
class GapOpening:
    """Opening of one gap at its fine sine nodes, θ increasing.

    ``opening`` is T, ``weight`` the Gauss-Chebyshev weight of ∫ T g dθ divided by T, ``modes`` b_n.
    """

    theta: Array
    opening: Array
    weight: Array
    modes: Array


@compiled_for_both
def count_sine_nodes(gap: Array, modes: int, top: int, per_wave: float) -> int:
    """Count the sine nodes of a gap at ``per_wave`` nodes per shortest wave.

    There are no fewer than ``modes``, those of its field.
    """
    widest = 0.0
    for i in range(1, 24):
        t = np.pi * i / 24
        widest = max(widest, theta_at(gap, np.cos(t))[1] * np.sin(t))
    waves = int(np.ceil(0.5 * per_wave * widest * top)) + FEWEST_SINE_NODES
    return fast_size(max(waves, modes))


@compiled_for_both
def fast_size(fewest: int) -> int:
    """Round up a number N of nodes to one that many gaps share, with a fast transform.

    N + 1 must have small prime factors.
    """
    eighth = 1
    while 16 * eighth <= fewest + 1:
        eighth *= 2
    # wide gaps are few, and their nodes take the time
    steps = (9, 10, 12, 15, 16) if fewest > _MANY_NODES else (12, 12, 12, 16, 16)
    for step in steps:
        if step * eighth - 1 >= fewest:
            return step * eighth - 1
    return 32 * eighth - 1


@compiled
def _fine_moments(
    gap: Array, panels: Panels, circle: Circle, theta: Array, theta_by_t: Array, modes: Array
) -> None:
    """Place the fine nodes of a gap, and compute s_n of all their modes."""
    count = theta.shape[0]
    place_nodes(gap, circle.cosine[1:], circle.sine[1:], theta, theta_by_t)
    load = interpolate(theta, panels.width, panels.stress)
    for i in range(count):
        load[i] *= theta_by_t[i]
    sine_sums(load, circle, modes)
    for n in range(count):
        modes[n] *= 2 / (count + 1)


@compiled
def _work_of_gaps(
    nodes: Nodes, load: Array, f: Array, rules: GaussRules, top: int, panels: Panels
) -> float:
    """Integrate S_full T dθ: by f, less π/2 s_n²/(n+1) of all modes above those of f."""
    table, orders, counts = nodes.table, nodes.orders, rules.counts
    total = 0.0
    last = 0
    circle = tabulate_circle(4)
    for k in range(table.shape[0]):
        m = counts[orders[k]]
        count = count_sine_nodes(table[k], m, top, ENERGY_NODES)
        if count != last:
            circle = tabulate_circle(count + 1)
            last = count
        theta, theta_by_t, modes = np.empty(count), np.empty(count), np.empty(count)
        _fine_moments(table[k], panels, circle, theta, theta_by_t, modes)
        for n in range(m, count):
            total += modes[n] * modes[n] / (n + 1)
    work = -np.pi / 2 * total
    for i in range(f.shape[0]):
        work += load[i, 0] * f[i]
    return work


def work_of_gaps(field: GapField) -> float:
    """Integrate S_full T dθ over the gaps."""
    solution, source = field.solution, field.source
    return _work_of_gaps(
        solution.nodes, solution.equations.load, solution.scaled_opening, GAUSS_RULES, source.top,
        source.panels,
    )  # fmt: skip


@compiled_for_both
def open_gap(
    nodes: Nodes, k: int, f: Array, circle: Circle, rules: GaussRules, panels: Panels
) -> tuple[Array, Array, Array, Array]:
    """Evaluate θ, falling, dθ/dt and T of gap k at the nodes of a circle, and b_n, from all f."""
    gap, order = nodes.table[k], nodes.orders[k]
    count = circle.cosine.shape[0] // 2 - 1
    theta, theta_by_t, modes = np.empty(count), np.empty(count), np.empty(count)
    _fine_moments(gap, panels, circle, theta, theta_by_t, modes)
    m = rules.counts[order]
    for n in range(m, count):
        modes[n] = -modes[n] / (n + 1)
    for n in range(m):
        total = 0.0
        for j in range(m):
            w = rules.weights[rules.vector_start[order] + j]
            mode = rules.modes[rules.matrix_start[order] + j * m + n]
            total += w * f[nodes.offset[k] + j] * mode
        modes[n] = 2 / np.pi * total
    opening = np.empty(count)
    sine_sums(modes, circle, opening)
    return theta, theta_by_t, opening, modes


def fine_opening(field: GapField, k: int, per_wave: float = SHAPE_NODES) -> GapOpening:
    """Evaluate the opening T of gap k at fine nodes."""
    solution = field.solution
    fewest = GAUSS_RULES.counts[solution.nodes.orders[k]]
    count = count_sine_nodes(solution.nodes.table[k], fewest, field.source.top, per_wave)
    theta, theta_by_t, opening, modes = open_gap(
        solution.nodes, k, solution.scaled_opening, tabulate_circle(count + 1), GAUSS_RULES,
        field.source.panels,
    )  # fmt: skip
    weight = theta_by_t * np.pi / (count + 1)
    return GapOpening(theta[::-1], opening[::-1], weight[::-1], modes)


def refine_opening(gap: Array, modes: Array, factor: int) -> tuple[Array, Array]:
    """Evaluate θ, increasing, and T at about ``factor`` times as many sine nodes as modes b_n."""
    count = fast_size(factor * (len(modes) + 1) - 1)
    circle = tabulate_circle(count + 1)
    more, theta, theta_by_t, opening = (
        np.zeros(count),
        np.empty(count),
        np.empty(count),
        np.empty(count),
    )
    more[: len(modes)] = modes
    place_nodes(gap, circle.cosine[1:], circle.sine[1:], theta, theta_by_t)
    sine_sums(more, circle, opening)
    return theta[::-1], opening[::-1]


@compiled_for_both
def sum_modes(gap: Array, theta: Array, modes: Array) -> Array:
    """Sum b_n sin((n+1)t), cos t = η(θ), over n by Clenshaw's recurrence."""
    out = np.empty(theta.shape[0])
    for i in range(theta.shape[0]):
        eta, square, _ = eta_at(gap, theta[i])
        b1 = 0.0
        b2 = 0.0
        for n in range(modes.shape[0] - 1, -1, -1):
            b1, b2 = 2 * eta * b1 - b2 + modes[n], b1
        out[i] = b1 * np.sqrt(square)
    return out
