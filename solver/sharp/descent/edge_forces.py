"""Forces on the edges, excess energy release rates, and the change of the energy over a step.

With n_e the outward motion of the contact at edge e, dU/dn_e = (π/8)(C_e |C_e| - C_c²): a closing
edge, C < 0, overlaps, and contact grows there all the same. Forces are in units of π/8.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adhesis.solver.model.profile import Array
from adhesis.solver.runtime.jit import compiled
from adhesis.solver.sharp.equilibrium.edge_law import EdgeLaw
from adhesis.solver.sharp.equilibrium.griffith import imbalance
from adhesis.solver.sharp.field.dense_solver import solve, solve_again
from adhesis.solver.sharp.field.exterior import Exterior
from adhesis.solver.sharp.field.solution import FieldModel, Solution
from adhesis.solver.sharp.gap.quadrature import Integers
from adhesis.solver.sharp.tolerances import ENERGY_ROUNDING


class FlowProblem(NamedTuple):
    """Constants of a problem that the compiled code of a descent takes.

    Attributes
    ----------
    law : EdgeLaw
        Griffith's condition, and lengths.
    model : FieldModel
    exterior : Exterior
        Of a window; NO_EXTERIOR where all gaps descend.
    """

    law: EdgeLaw
    model: FieldModel
    exterior: Exterior


class Forces(NamedTuple):
    """Field of given edges, and the forces on them.

    Attributes
    ----------
    solution : Solution
    residual : array, shape (2L,)
        C - C_c, positive where contact recedes.
    drift : array, shape (2L,)
        dC_c/dθ.
    slope : array, shape (2L,)
        dU/dn = C |C| - C_c²; the force is its opposite. NaN where the edges have no field.
    """

    solution: Solution
    residual: Array
    drift: Array
    slope: Array


@compiled
def forces_at(
    gaps: Array, prescribed: float, orders: Integers, before: Solution, problem: FlowProblem
) -> Forces:
    """Solve the field of these gaps, and evaluate the forces.

    Nodes, moments and kernels of gaps that are as they were in the solution ``before`` are kept.
    """
    law, panels = problem.law, problem.model.panels
    solution = solve_again(gaps, prescribed, orders, problem.model, problem.exterior, before)
    edges = 2 * gaps.shape[0]
    slope = np.full(edges, np.nan)
    if not np.isfinite(solution.pressure):
        return Forces(solution, slope, slope, slope)
    residual, drift = imbalance(solution, law, panels)
    openings = solution.opening
    for e in range(edges):
        opening = openings[e]
        critical = opening - residual[e]
        slope[e] = opening * abs(opening) - critical * critical
    return Forces(solution, residual, drift, slope)


@compiled
def norm(force: Array) -> float:
    """Compute the Euclidean norm."""
    square = 0.0
    for e in range(force.shape[0]):
        square += force[e] * force[e]
    return float(np.sqrt(square))


@compiled
def energy_rises(before: Array, after: Array, step: Array) -> bool:
    """Whether the energy rises over a step, by more than rounding of the work done either way.

    ``before`` and ``after`` are dU/dn at both ends of the step (trapezoidal rule).
    """
    change = 0.0
    work = 0.0
    for e in range(step.shape[0]):
        of_edge = 0.5 * (before[e] + after[e]) * step[e]
        change += of_edge
        work += abs(of_edge)
    return change > ENERGY_ROUNDING * work


@compiled
def slope_along(
    gaps: Array, step: Array, prescribed: float, orders: Integers, problem: FlowProblem
) -> float:
    """Evaluate the force along ``step`` at these gaps: positive where the energy falls."""
    of = solve(gaps, prescribed, orders, 1, problem.model, problem.exterior)
    residual, _ = imbalance(of, problem.law, problem.model.panels)
    force = 0.0
    for e in range(step.shape[0]):
        force -= residual[e] * (2 * of.opening[e] - residual[e]) * step[e]
    return force
