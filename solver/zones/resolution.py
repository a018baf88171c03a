"""Nodes that resolve the zones of a problem."""

from __future__ import annotations

import math

from scipy.fft import next_fast_len

from adhesis.solver.model.problem import Problem

COARSE = 0.03
"""Relative error of a drop times the number of nodes in a zone."""

_OF_ZONE, _OF_WAVE, _FEWEST_NODES = 5, 40, 512  # more have to be asked for


def zone_length(problem: Problem) -> float:
    """Return the length (π/4) E*δ²/γ in m of a zone that is short beside all else."""
    delta = problem.attraction_range
    return float(math.pi / 4 * problem.half_space.modulus * delta**2 / problem.work_of_adhesion)


def node_count(problem: Problem, nodes_per_wave: int | None = None) -> int:
    """Return the number of nodes that resolve zones and waves: even, with small prime factors."""
    wanted = float(max(_FEWEST_NODES, (nodes_per_wave or _OF_WAVE) * problem.highest_harmonic))
    if nodes_per_wave is None:
        wanted = max(wanted, _OF_ZONE * problem.profile.period / zone_length(problem))
    return 2 * int(next_fast_len(math.ceil(wanted / 2), real=True))
