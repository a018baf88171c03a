"""Which losses are doubtful: those whose own checks say that they are off by a share that counts.

A loop is checked twice by what it knows itself: the audit compares the loop integral with the sum
of the energy drops, and the estimated numerical error is that of both.
"""

from __future__ import annotations

from typing import Any

import numpy as np

# A loss that is off by more than this, or by ten times the accuracy that was asked for, is said.
LARGE = 0.02


def bound(accuracy: float) -> float:
    """Return the relative error above which a loss is doubtful, for the accuracy asked for."""
    return max(LARGE, 10 * accuracy)


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
