"""Grids with a given number of nodes."""

from adhesis import Problem
from adhesis.solver.grid.method import GridMethod


def grid_of(problem: Problem, nodes: int, accuracy: float = 1e-3) -> GridMethod:
    """Make the method on a grid of ``nodes`` nodes, a power of two."""
    per_wave = nodes // problem.profile.highest_harmonic
    method = GridMethod(problem, accuracy=accuracy, nodes_per_wave=per_wave)
    assert method.nodes == nodes
    return method
