"""Decide which losses are doubtful, and word what is known of loops short of their preload.

A loss is doubtful if its estimated error exceeds the requested accuracy.

A loop has two estimates of its error: the audit compares the loop integral with the sum of the
energy drops, and ``loss_error`` is the estimated numerical error of both. The latter was compared
with actual errors (docs/methods.md, "How far the reported error holds"), and is used without a
safety factor.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adhesis.ensemble.quantities import percent, stress_text
from adhesis.solver.checks import counted
from adhesis.solver.loading import zero_range as limits

# Numbers of a row from which beyond_zero_range decides, in the order of beyond_limit.
_OF_LIMIT = (
    *("valid_range", "loss", "work_of_adhesion", "largest_contact_fraction"),
    *("opening_strength", "edge_range", "touch_range", "turn_range", "gamma_open"),
)
OF_DOUBT = ("audit_residual", "loss_error", "loss", "work_of_adhesion")
"""Numbers of a row from which :func:`doubtful` decides."""
INSTEAD = (
    "Rougher profiles or a stiffer material let loops reach it, or a smaller preload, unless all "
    "contact is in tension"
)


def why_beyond(opens: bool) -> str:
    """Return why losses are beyond zero range; ``opens``: whether adhesion has a range."""
    if opens:
        return (
            f"the tension inside patches exceeds the strength more than {limits.DOUBTFUL_EXCESS:g} "
            "times, where patches would open from inside, or the range of adhesion is longer than "
            f"touch_range, turn_range or {limits.EDGE_SHARE:.2g} of edge_range, so that what the "
            "method 'sharp' leaves out matters for it; take the method 'zones' (docs/zero-range.md)"
        )
    return (
        f"{limits.ANY_RANGE} is below {limits.DOUBTFUL_RANGE:g} m, or the loss above "
        f"{limits.DOUBTFUL_LOSS:g} times the work of adhesion of the largest contact, so that "
        "an interface of finite range would lose less (docs/zero-range.md)"
    )


def doubtful_losses(count: int, why: str, of: int | None = None) -> str:
    """Return "2 losses are doubtful: …", or "1 of 3 losses is doubtful, as …"."""
    counts = counted(count, "loss") if of is None else f"{count} of {counted(of, 'loss')}"
    return f"{counts} {'is' if count == 1 else 'are'} doubtful{why}"


def errors_text(row: Mapping[str, Any]) -> str:
    """Return "audit residual 0.2 %, estimated error 3 %" of the loss of a row.

    None stands for a number that is not finite.
    """
    names = ("loss", "loss_error", "audit_residual")
    loss, error, audit = (np.nan if row[name] is None else row[name] for name in names)
    error /= abs(loss) or 1.0
    return f"audit residual {percent(audit)}, estimated error {percent(error)}"


def doubtful(values: Mapping[str, Any], accuracy: float) -> NDArray[np.bool_]:
    """Return which losses are less accurate than asked for, by their own account, or no numbers.

    ``values`` are numbers or columns of rows, by the names of the results file. Without adhesion
    nothing is lost, and no accuracy of it is doubted.
    """
    is_known = np.asarray(values["loss_error"]) <= accuracy * np.abs(values["loss"])
    is_known &= np.abs(values["audit_residual"]) <= accuracy
    is_nothing = np.isfinite(values["loss"]) & (np.asarray(values["work_of_adhesion"]) == 0)
    return np.asarray(~(is_known | is_nothing))


def beyond_zero_range(
    values: Mapping[str, Any], stiffness: float | None = None
) -> NDArray[np.bool_]:
    """Return which losses an adhesion of finite range may not have; see :func:`doubtful`.

    What a ``stiffness`` (Pa/m) that holds the solid stores at pull-off is no loss of the solid.
    """
    if stiffness is not None:
        stored = limits.stored_at_pull_off(values["pull_off_stress"], stiffness)
        values = {**values, "loss": values["loss"] - stored}
    return limits.beyond_limit(*(values[name] for name in _OF_LIMIT))


def highest_stress(loading: ArrayLike) -> float:
    """Return the highest mean stress in Pa at the load steps of loops, NaN where there is none."""
    return float(np.max(np.nan_to_num(loading, nan=-np.inf)))


def most_reached(highest: float) -> str:
    """Return "at load steps the mean stress is at most 3 kPa", or that all contact is in tension.

    Between load steps it may be higher, up to a jump: rows of results hold load steps alone.
    """
    if highest <= 0:
        return "at load steps the mean stress is a tension wherever there is contact"
    return f"at load steps the mean stress is at most {stress_text(highest)}"
