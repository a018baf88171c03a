"""Decide which losses are doubtful: those whose estimated error exceeds the requested accuracy.

A loop has two estimates of its error: the audit compares the loop integral with the sum of the
energy drops, and ``loss_error`` is the estimated numerical error of both. The latter was compared
with actual errors (docs/methods.md, "Error of the loss"), and is used without a safety factor.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from adhesis.solver.loading.zero_range import (
    DOUBTFUL_BARRIER,
    DOUBTFUL_EXCESS,
    DOUBTFUL_LOSS,
    DOUBTFUL_RANGE,
)

BEYOND_LIMIT = (
    f"valid_range, edge_range or touch_range is below {DOUBTFUL_RANGE:g} m, or the loss above "
    f"{DOUBTFUL_LOSS:g} times the work of adhesion of the largest contact, so that an interface of "
    "finite range would lose less (docs/zero-range.md)"
)
"""Why losses are doubtful that are those of the zero-range limit alone."""

BEYOND_STRENGTH = (
    f"the tension inside patches exceeds the strength more than {DOUBTFUL_EXCESS:g} times, or the "
    f"barriers of openings are more than {DOUBTFUL_BARRIER:g} of the loss, or the range of "
    "adhesion is longer than edge_range or touch_range, so that what zero range leaves open "
    "matters for it (docs/zero-range.md)"
)
"""Why losses are doubtful where patches open from inside."""


def why_beyond(opens: bool) -> str:
    """Return why losses of a campaign are beyond what zero range describes."""
    return BEYOND_STRENGTH if opens else BEYOND_LIMIT


def bound(accuracy: float) -> float:
    """Return the relative error above which a loss is doubtful: the requested accuracy."""
    return accuracy


def doubtful(
    accuracy: float, loss: Any, audit_residual: Any, loss_error: Any = 0.0
) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return which losses are doubtful; values or arrays of one shape.

    Parameters
    ----------
    accuracy : float
        Requested relative error.
    loss, loss_error : float or array
        In J/m².
    audit_residual : float or array
        (loss - loss_from_drops) / loss.
    """
    largest = bound(accuracy)
    error = np.asarray(loss_error) > largest * np.abs(np.asarray(loss))
    return np.asarray((np.abs(np.asarray(audit_residual)) > largest) | error)
