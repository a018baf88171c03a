"""Corrector: the equilibrium next to a predicted state, with all gaps or in a window."""

from __future__ import annotations

import numpy as np

from adhesis.solver.sharp.continuation.local_branch import LocalBranch, confirmed
from adhesis.solver.sharp.continuation.predictor import Predictor
from adhesis.solver.sharp.equilibrium.branch_point import Point
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.tolerances import CORRECTED


def correct(edges: EdgeMechanics, predictor: Predictor, at: float) -> Point | None:
    """Return the stable equilibrium of all edges at d = ``at`` near the predicted one, or None.

    Raises
    ------
    LostTrack
        If the point that is predicted from is no equilibrium of all edges.
    """
    reached = edges.equilibrium(predictor.gaps(at), at, CORRECTED * edges.wave)
    if reached is None or not edges.uses_windows(reached.gaps):
        return reached
    return reached.with_earlier(confirmed(predictor.point))


def correct_in_window(
    edges: EdgeMechanics, predictor: Predictor, at: float, window: LocalBranch | None
) -> tuple[Point | None, LocalBranch]:
    """Return the equilibrium in a window near the predicted one, or None; and the window.

    ``window`` is that of the point predicted from; where it is no longer valid, another is set up.
    It may lead less far than to d = ``at``.

    Raises
    ------
    LostTrack
        If the point that is predicted from is no equilibrium of all edges.
    """
    point = predictor.point
    if window is None or not (window.is_valid(at) or window.begins_at(point)):
        point = confirmed(point)
        window = LocalBranch(edges, point)
    if not window.is_valid(at):
        at = point.at + float(np.copysign(window.span, at - point.at))
    return window.equilibrium(predictor.gaps(at), at, CORRECTED * edges.wave), window
