"""Which losses are doubtful: those that by their own account miss the accuracy asked for.

A loop is checked twice by what it knows itself: the audit compares the loop integral with the sum
of the energy drops, and the estimated numerical error is that of both. How the latter compares with
the errors that are made is measured (docs/methods.md, "Error of the loss"), so that it can be held
against the accuracy as it is.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from adhesis.solver.interior import DOUBTFUL_LOSS, DOUBTFUL_RANGE

BEYOND_LIMIT = (
    f"valid_range is below {DOUBTFUL_RANGE:g} m, or the loss above {DOUBTFUL_LOSS:g} times the "
    "work of adhesion of the largest contact, so that an interface of finite range would open from "
    "inside and lose less (docs/zero-range.md)"
)
"""Why losses are doubtful that are those of the zero-range limit alone."""


def bound(accuracy: float) -> float:
    """Return the relative error above which a loss is doubtful: the accuracy asked for."""
    return accuracy


def doubtful(
    accuracy: float, loss: Any, audit_residual: Any, loss_error: Any = 0.0
) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return which losses are doubtful; values or arrays of one shape.

    Parameters
    ----------
    accuracy : float
        The relative error that was asked for.
    loss, loss_error : float or array
        In J/m².
    audit_residual : float or array
        (loss - loss_from_drops) / loss.
    """
    most = bound(accuracy)
    error = np.asarray(loss_error) > most * np.abs(np.asarray(loss))
    return np.asarray((np.abs(np.asarray(audit_residual)) > most) | error)
