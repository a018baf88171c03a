"""Corrector: the equilibrium next to a predicted state."""

from __future__ import annotations

import numpy as np

from adhesis.solver._kernels import COMPARABLE
from adhesis.solver.sharp.continuation.predictor import Predictor
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import LONGEST_STEP


def correct(edges: EdgeMechanics, predictor: Predictor, at: float) -> Point | None:
    """Return the stable equilibrium of all edges at d = ``at`` near the predicted one, or None.

    None, too, where an edge is predicted to move far: what is found there may be another branch.
    """
    gaps = predictor.gaps(at)
    # not written as > : a prediction that is no number is none
    if not np.abs(gaps - predictor.point.gaps).max() <= COMPARABLE * edges.wave:
        return None
    return edges.equilibrium(gaps, at, LONGEST_STEP * edges.wave, memory=predictor.point.gaps)
