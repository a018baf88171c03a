"""Control of the length of long steps in a descent, compiled.

Long steps, of the flow through the model, go as far as their reach: their error is the difference
between the openings of the model and those of the field at the end, and grows as the square of
their length.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.model_flow import ModelFlow
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw, critical_opening
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import (
    LONGEST_REACH,
    MODEL_ERROR,
    MODEL_SHARE,
    REACH_CUT,
    REACH_GROWTH,
    REACH_SAFETY,
)


@compiled
def model_error(
    flow: ModelFlow, residual: Array, edges: Integers, gaps: Array, law: EdgeLaw, panels: Panels
) -> float:
    """Measure by how much the openings of the model are wrong, in units of what is allowed.

    ``residual`` is C - C_c of the field at the end. On the way the errors are taken to grow as the
    square of its length, and far from balance more is allowed.
    """
    lengths, residuals = flow.lengths, flow.residuals
    last = lengths.shape[0] - 1
    worst = 0.0
    for e in range(residual.shape[0]):
        critical, _ = critical_opening(gaps[edges[e] // 2, edges[e] % 2], law, panels)
        at_end = abs(residual[e] + critical - flow.opening[e])
        for i in range(last + 1):
            share = lengths[i] / lengths[last]
            error = share * share * at_end
            unbalance = max(abs(residuals[i, e]) - error, 0.0)
            allowed = MODEL_ERROR * law.critical + MODEL_SHARE * unbalance
            # not written as > : an error that is no number is too large
            if not error <= worst * allowed:
                worst = error / allowed
    return worst


@compiled
def next_reach(before: float, length: float, error: float) -> float:
    """Choose the next reach after a long step of this length, in longest steps, and error."""
    factor = min(REACH_GROWTH, max(REACH_CUT, REACH_SAFETY / np.sqrt(max(error, 1e-9))))
    reach: float = length * factor
    if error <= 1:
        reach = max(reach, before if factor >= 1 else 0.0)
    return min(reach, LONGEST_REACH)
