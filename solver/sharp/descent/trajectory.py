"""Trajectory of a descent in the space of the edges, and its comparison with another one's.

Two descents from the same edges by different kinetics end in the same minimum once the second has
come back to the trajectory of the first: from there on the first is followed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.tolerances import (
    MODEL_STEP,
    ON_TRAJECTORY,
    SEGMENT_MARGIN,
    SEGMENT_SHARE,
)


class Trajectory(NamedTuple):
    """Edges that a descent went through: the first ``length`` rows.

    Attributes
    ----------
    points : array, shape (n, 2L)
    length : int
    """

    points: Array
    length: int


class Comparison(NamedTuple):
    """Comparison of a descent with the trajectory of another one.

    Attributes
    ----------
    trajectory : array, shape (n, 2L)
        That of the other descent; no rows for none.
    has_left : bool
        Whether this descent has been away from it.
    matches : int
        In how many comparisons in a row this descent was on it again.
    """

    trajectory: Array
    has_left: bool
    matches: int


@compiled
def start_trajectory(gaps: Array) -> Trajectory:
    """Begin a trajectory at these gaps."""
    points = np.empty((64, 2 * gaps.shape[0]))
    points[0] = gaps.ravel()
    return Trajectory(points, 1)


@compiled
def append_point(trajectory: Trajectory, edges: Array) -> Trajectory:
    """Add a point to a trajectory."""
    points, length = trajectory.points, trajectory.length
    if length == points.shape[0]:
        longer = np.empty((2 * length, points.shape[1]))
        longer[:length] = points
        points = longer
    points[length] = edges
    return Trajectory(points, length + 1)


@compiled
def update_comparison(comparison: Comparison, gaps: Array, longest: float) -> Comparison:
    """Compare these gaps with the other trajectory; ``longest`` is the longest step."""
    if comparison.trajectory.shape[0] == 0:
        return comparison
    distance = distance_to(comparison.trajectory, gaps.ravel(), longest)
    away = distance > ON_TRAJECTORY * longest
    has_left = comparison.has_left or away
    matches = comparison.matches + 1 if has_left and not away else 0
    return Comparison(comparison.trajectory, has_left, matches)


@compiled
def distance_to(trajectory: Array, at: Array, longest: float) -> float:
    """Measure the largest distance of an edge from a trajectory, at its nearest; inf if far."""
    longest_segment = SEGMENT_MARGIN * MODEL_STEP * longest
    least = np.inf
    for i in range(trajectory.shape[0] - 1):
        along = 0.0
        square = 0.0
        widest = 0.0
        for e in range(at.shape[0]):
            way = trajectory[i + 1, e] - trajectory[i, e]
            off = at[e] - trajectory[i, e]
            widest = max(widest, abs(way), SEGMENT_SHARE * abs(off))
            if widest > longest_segment:  # far, or between two descents' trajectories
                break
            along += way * off
            square += way * way
        if widest > longest_segment or square == 0:
            continue
        share = min(max(along / square, 0.0), 1.0)
        worst = 0.0
        for e in range(at.shape[0]):
            way = trajectory[i + 1, e] - trajectory[i, e]
            worst = max(worst, abs(at[e] - trajectory[i, e] - share * way))
        least = min(least, worst)
    return least
