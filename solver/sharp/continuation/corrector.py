"""Corrector: the equilibrium next to a predicted state."""

from __future__ import annotations

from adhesis.solver.sharp.continuation.predictor import Predictor
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import CORRECTED


def correct(edges: EdgeMechanics, predictor: Predictor, at: float) -> Point | None:
    """Return the stable equilibrium of all edges at d = ``at`` near the predicted one, or None."""
    return edges.equilibrium(predictor.gaps(at), at, CORRECTED * edges.wave)
