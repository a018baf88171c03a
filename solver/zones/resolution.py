"""Nodes that resolve the zones of a problem, and the error that they leave."""

from __future__ import annotations

import math

import numpy as np
from scipy.fft import next_fast_len

from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array

_OF_ZONE, _OF_CREST, _OF_WAVE, _FEWEST_NODES = 4, 6, 40, 512  # more have to be asked for
_BY_EDGES, _BY_CURVES = 0.05, 0.4  # of the drops: errors times squares of the first two


def zone_length(problem: Problem) -> float:
    """Return the length (π/4) E*δ²/γ in m of a zone that is short beside all else."""
    delta = problem.attraction_range
    return float(math.pi / 4 * problem.half_space.modulus * delta**2 / problem.work_of_adhesion)


def crest_length(problem: Problem) -> float:
    """Return sqrt(2δ/h''_rms) in m: so far from a crest that touches a rigid flat the gap is δ."""
    profile, n = problem.profile, 4 * problem.profile.highest_harmonic
    x: Array = profile.period / n * np.arange(n, dtype=np.float64)
    bend = profile.at(x, derivative=2)
    return float(math.sqrt(2 * problem.attraction_range / np.sqrt(np.mean(bend**2))))


def node_count(problem: Problem, nodes_per_wave: int | None = None) -> int:
    """Return the number of nodes that resolve zones and waves: even, with small prime factors."""
    wanted = float(max(_FEWEST_NODES, (nodes_per_wave or _OF_WAVE) * problem.highest_harmonic))
    if nodes_per_wave is None:
        lengths = zone_length(problem) / _OF_ZONE, crest_length(problem) / _OF_CREST
        wanted = max(wanted, problem.profile.period / min(lengths))
    return 2 * int(next_fast_len(math.ceil(wanted / 2), real=True))


def relative_error(problem: Problem, dx: float) -> float:
    """Return the share of their drops by which jumps are off with nodes dx apart, in m.

    From waves in closed form, and random profiles with up to 16 times the nodes.
    """
    lengths = zone_length(problem), crest_length(problem)
    by_edges, by_curves = ((dx / length) ** 2 for length in lengths)
    return _BY_EDGES * by_edges + _BY_CURVES * by_curves
