"""Short step of a descent, compiled: on the linear flow, or off a saddle."""

from __future__ import annotations

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.descent.bound_constrained_step import bound_constrained_step
from adhesis.solver.sharp.descent.edge_forces import FlowProblem, Forces
from adhesis.solver.sharp.descent.linear_kinetics import flow_step, hessian
from adhesis.solver.sharp.descent.saddle import QuadraticModel, step_off_saddle
from adhesis.solver.sharp.equilibrium.griffith import symmetrise
from adhesis.solver.sharp.gap.quadrature import Integers


@compiled
def short_step(
    gaps: Array, prescribed: float, orders: Integers, now: Forces, tangent: Array, limit: Array,
    equal_speeds: bool, system: FlowProblem,
) -> tuple[Array, Array, int]:  # fmt: skip
    """Choose a step within the limits: outward motions, curvature of the energy, fields solved.

    By linear kinetics edges move in proportion to their excess energy release rates. With equal
    speeds, for comparison, edges out of equilibrium run, all at the same speed (their limit), and
    edges near equilibrium follow them by Newton's step.
    """
    law, opening = system.law, now.solution.opening
    curvature = hessian(np.maximum(opening, 0.0), now.residual, now.drift, tangent)
    if equal_speeds:
        values, matrix = symmetrise(now.solution, tangent, law.overlap_limit)
        step = bound_constrained_step(matrix, values, -now.residual, limit)
    else:
        values, matrix = np.linalg.eigh(curvature)
        step = flow_step(values, matrix, -now.slope, limit, law.force_error)
    model = QuadraticModel(values, matrix, limit)
    close_overlaps(step, opening, limit, law.overlap_limit)
    tried = 0
    if np.abs(step).max() <= law.field_error:
        step, tried = step_off_saddle(step, model, gaps, prescribed, orders, equal_speeds, system)
    return step, curvature, tried


@compiled
def close_overlaps(step: Array, opening: Array, limit: Array, overlapping: float) -> None:
    """Let contact grow as far as it may at edges beside which surfaces would overlap."""
    for e in range(step.shape[0]):
        if opening[e] < -overlapping:
            step[e] = limit[e]
