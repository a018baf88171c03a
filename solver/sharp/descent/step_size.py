"""Control of the step size in a descent, compiled.

Two lengths are controlled. Short steps, of the linear flow, are a ``share`` of the longest step of
an edge (``EdgeLaw.longest_step``); it is halved when a step raised the energy, and doubled after
each that lowered it. Long steps, of the flow through the model, go as far as the ``reach``: their
error is the difference between the openings of the model and those of the field at the end, and
grows as the square of their length.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.model_flow import ModelFlow
from adhesis.solver.sharp.tolerances import (
    FIRST_REACH,
    LEAST_STEP_SHARE,
    LONGEST_REACH,
    MODEL_ERROR,
    MODEL_SHARE,
    REACH_CUT,
    REACH_GROWTH,
    REACH_SAFETY,
    RECOVERY,
)


class StepSize(NamedTuple):
    """State of the step-size control.

    Attributes
    ----------
    share : float
        Of the longest step, for short steps.
    reach : float
        Of long steps, in longest steps; below ``LEAST_REACH`` the next step is a short one.
    """

    share: float
    reach: float


@compiled
def initial_size() -> StepSize:
    """Begin with short steps of full length."""
    return StepSize(1.0, FIRST_REACH)


@compiled
def after_short_step(size: StepSize, lowered: bool) -> StepSize:
    """Double the share after a step that lowered the energy, else halve it."""
    share = min(1.0, 2 * size.share) if lowered else 0.5 * size.share
    return StepSize(share, RECOVERY * size.reach if lowered else size.reach)


@compiled
def model_error(flow: ModelFlow, field: Array, critical: float) -> float:
    """Measure by how much the openings of the model are wrong, in units of what is allowed.

    ``field`` are the openings of the field at the end. On the way the errors are taken to grow as
    the square of its length, and far from balance more is allowed.
    """
    lengths, residuals = flow.lengths, flow.residuals
    last = lengths.shape[0] - 1
    worst = 0.0
    for i in range(last + 1):
        share = lengths[i] / lengths[last]
        for e in range(field.shape[0]):
            error = share * share * abs(field[e] - flow.opening[e])
            unbalance = max(abs(residuals[i, e]) - error, 0.0)
            worst = max(worst, error / (MODEL_ERROR * critical + MODEL_SHARE * unbalance))
    return worst


@compiled
def after_long_step(size: StepSize, length: float, error: float) -> StepSize:
    """Choose the next reach after a long step of this length, in longest steps, and error."""
    factor = min(REACH_GROWTH, max(REACH_CUT, REACH_SAFETY / np.sqrt(max(error, 1e-9))))
    reach = length * factor
    if error <= 1:
        reach = max(reach, size.reach if factor >= 1 else 0.0)
    return StepSize(size.share, min(reach, LONGEST_REACH))


@compiled
def may_raise(size: StepSize) -> bool:
    """Whether short steps are so short that a rise of the energy is taken for rounding."""
    return size.share <= LEAST_STEP_SHARE
