"""Control of the step size in a descent, compiled.

A step is bounded by the longest step of a running edge (``EdgeLaw.longest``) times three factors:

- ``share``, halved when a step raised the energy, doubled after each that lowered it;
- a reduction for a single edge that turns to and fro over a minimum;
- ``stride``, which doubles while edges run. Steps longer than one unchecked step are checked for a
  minimum that they leap over (``step_check``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import (
    LEAST_STEP_SHARE,
    LONGEST_STRIDE,
    LONGEST_STRIDE_ALONE,
    REUSES,
    REUSES_ALONE,
    RUNNING_LENGTH,
    RUNNING_SHARE,
    TURNING_SHARE,
    TURNS,
    TURNS_FACTOR,
    UNCHECKED_ALONE,
)


class StepSize(NamedTuple):
    """State of the step-size control.

    Attributes
    ----------
    share : float
        Of the longest step; below 1 after a step that raised the energy.
    stride : float
        Length of the last long step in longest steps; 0 after one that was cut short.
    running : int
        Number of edges that ran in the last step; 0 asks for a new tangent.
    reuses : int
        Steps beyond the first that used the present tangent.
    turns : int
        How often a single running edge has turned.
    """

    share: float
    stride: float
    running: int
    reuses: int
    turns: int


class StepLengths(NamedTuple):
    """Lengths that bound one step, in θ: the longest step, one unchecked, and one checked."""

    longest: float
    unchecked: float
    reach: float


@compiled
def initial_size() -> StepSize:
    """Begin with unchecked steps of full length."""
    return StepSize(1.0, 0.0, 0, 0, 0)


@compiled
def after_rejection(size: StepSize) -> StepSize:
    """Halve the steps, after one that raised the energy."""
    return StepSize(0.5 * size.share, size.stride, 0, size.reuses, size.turns)


@compiled
def after_cut(size: StepSize) -> StepSize:
    """Begin again with short steps, after one that leapt over a minimum."""
    return StepSize(size.share, 0.0, 0, size.reuses, size.turns)


@compiled
def after_turn(size: StepSize) -> StepSize:
    """Count a turn, if a single edge ran, and ask for a new tangent."""
    turns = size.turns + (1 if size.running == 1 else 0)
    return StepSize(size.share, size.stride, 0, size.reuses, turns)


@compiled
def after_fall(size: StepSize) -> StepSize:
    """Double the share, up to full steps, after a step that lowered the energy."""
    return StepSize(
        min(1.0, 2 * size.share), size.stride, size.running, size.reuses, size.turns
    )


@compiled
def keeps_tangent(size: StepSize) -> bool:
    """Whether the next step may use the tangent of the last one: only while edges run."""
    return size.running > 0 and size.reuses < (REUSES_ALONE if size.running == 1 else REUSES)


@compiled
def with_running(size: StepSize, running: int) -> StepSize:
    """Note how many edges run in the step that is taken."""
    return StepSize(size.share, size.stride, running, size.reuses, size.turns)


@compiled
def next_lengths(size: StepSize, longest: float) -> tuple[StepSize, StepLengths]:
    """Choose the lengths that bound the next step, ``longest`` being a full one."""
    reduction = TURNS_FACTOR ** max(size.turns - TURNS, 0)
    longest = size.share * max(reduction, LEAST_STEP_SHARE) * longest
    alone = size.running == 1
    unchecked = UNCHECKED_ALONE * longest if alone else longest
    reach = unchecked
    stride = size.stride
    if size.running > 0:
        stride = min(max(2 * stride, 1.0), LONGEST_STRIDE_ALONE if alone else LONGEST_STRIDE)
        reach = max(reach, stride * longest)
    reuses = size.reuses + 1 if keeps_tangent(size) else 0
    next_size = StepSize(size.share, stride, size.running, reuses, size.turns)
    return next_size, StepLengths(longest, unchecked, reach)


@compiled
def turns_back(step: Array, last: Array, reach: float) -> bool:
    """Whether an edge that is to move far would turn: an old tangent does not decide that."""
    for e in range(step.shape[0]):
        if abs(step[e]) > TURNING_SHARE * reach and step[e] * last[e] <= 0:
            return True
    return False


@compiled
def running_edges(step: Array, longest: float) -> Integers:
    """List the edges that run in a step: none if the step is short."""
    size = np.abs(step).max()
    if size > RUNNING_LENGTH * longest:
        return np.flatnonzero(np.abs(step) > max(RUNNING_SHARE * size, RUNNING_LENGTH * longest))
    return np.empty(0, dtype=np.int64)
