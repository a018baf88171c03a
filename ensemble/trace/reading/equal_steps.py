"""Put heights at given positions on equal steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adhesis.ensemble.errors import InputError, parameter
from adhesis.ensemble.quantities import length_text
from adhesis.solver.checks import counted
from adhesis.solver.model.profile import Array

# Positions within this share of a step of equal ones are taken as these. Where they drift further,
# but no step differs by more than this share, heights are interpolated.
_UNEVEN = 0.10
# Positions that are printed in whole multiples of a digit may be rounded: at least so many of their
# steps differ from the others (one or two are rows left out), the step is at least this share of a
# digit, and its bounds lie within this share of it.
_IRREGULAR, _FINEST, _SURE = 3, 0.1, 0.02
# Of one trace a rise between neighbours exceeds that to a later one by less than this factor.
_JUMPS = 1.5
_DIGITS = range(-6, 16)  # decimals that are looked for


def equal_steps(
    name: str, x: Array, metres: float, heights: Array, lines: Array | None
) -> tuple[Array, float, list[str]]:
    """Return heights at equal steps, the step in m, and a description of what was done.

    Positions ``x`` are in a unit of so many ``metres``, heights in m; both have shape (n,), as the
    ``lines`` of the file that each row stands on. InputError if a position is missing, or they turn
    back, stand still or have unequal steps.
    """
    notes: list[str] = []

    def place(k: int) -> str:
        return f"point {k} of {name}" if lines is None else f"line {int(lines[k])} of {name}"

    if not np.all(np.isfinite(x)):
        where = place(int(np.argmin(np.isfinite(x))))
        raise InputError(f"{where} has no position: write it, or remove the row")
    if np.all(np.diff(x) <= 0):
        x, heights = x[::-1], heights[::-1]
        lines = None if lines is None else lines[::-1]
        notes.append("positions ran backwards: turned round")
    digit, steps = _printed_digit(x), np.diff(x)
    step = None if digit is None else _step_of_rounded(x, digit)
    if digit is not None and step is not None:
        _refuse_interleaved(name, x, heights)
        notes.append(
            f"positions rounded to {length_text(digit * metres)}: equal steps of "
            f"{length_text(step * metres, 5)}"
        )
        return heights, step * metres, notes
    if np.any(steps <= 0):
        back = int(np.argmax(steps <= 0)) + 1
        word = "stand still" if steps[back - 1] == 0 else "turn back"
        raise InputError(
            f"the positions {word} at {place(back)}: they must rise or fall throughout, so keep "
            "the rows of one pass, or save them with more decimals if they are rounded"
        )
    if digit is not None and round(float(np.median(steps)) / digit) == 1:
        # Rounding makes double steps, and so do rows that are left out.
        doubles = int(np.sum(np.rint(steps / digit) == 2))
        if doubles >= _IRREGULAR:
            raise InputError(
                f"the positions of {name} are whole multiples of {length_text(digit * metres)}, "
                f"{doubles} of them two apart: they may be rounded, or rows are left out; save "
                "them with more decimals, or write the rows that are left out, with NaN"
            )
    return _on_grid(x * metres, heights, place, notes)


def _on_grid(
    x: Array, heights: Array, place: Callable[[int], str], notes: list[str]
) -> tuple[Array, float, list[str]]:
    """Return heights on the grid that their positions in m lie on, some of them left out."""
    steps = np.diff(x)
    middle = float(np.median(steps))
    apart = np.rint(steps / middle).astype(int)
    index = np.concatenate([[0], np.cumsum(apart)])
    step = float((x[-1] - x[0]) / max(index[-1], 1))
    off = np.abs(x - x[0] - index * step) / step
    is_grid = apart.sum() <= 4 * heights.size and apart.min() >= 1
    if not is_grid or off.max() > _UNEVEN:
        uneven = float(np.abs(steps / step - 1).max())
        # Drift of the scanner: the number of steps is right, the positions are not.
        if is_grid and np.all(apart == 1) and uneven <= _UNEVEN:
            even = np.linspace(x[0], x[-1], x.size)
            notes.append(f"unequal steps ({100 * uneven:.1f} %) put on equal ones, linearly")
            return np.interp(even, x, heights), step, notes
        far = int(np.argmax(off)) if is_grid else int(np.argmax(np.abs(steps - middle))) + 1
        raise InputError(
            f"the steps of the positions are unequal: {middle:.4g} m mostly, and "
            f"{x[far] - x[far - 1]:.4g} m at {place(far)}; save them with more decimals if they "
            "are rounded"
        )
    if index[-1] + 1 > x.size:
        whole = np.full(index[-1] + 1, np.nan)
        whole[index] = heights
        notes.append(f"{counted(whole.size - x.size, 'position')} left out: taken as drop-outs")
        heights = whole
    return heights, step, notes


# ---------------------------------------------------------------------- positions rounded in print


def _step_of_rounded(x: Array, digit: float) -> float | None:
    """Return the step of equal steps that are rounded to a digit in print; None for others.

    Every position lies within half a digit of a grid of as many points, and the steps alternate in
    a way that this explains.
    """
    x, steps = x - x[0], np.diff(x)
    if np.any(steps < 0) or np.ptp(steps) > 2.5 * digit:  # rounding makes it two digits at most
        return None
    middle = float(np.median(steps))
    if np.sum(np.abs(steps - middle) > max(digit / 2, _UNEVEN * middle)) < _IRREGULAR:
        return None
    from scipy.optimize import linprog  # here: they take long to load
    from scipy.spatial import ConvexHull

    # A straight line that passes within half a digit of the corners does so of all positions; the
    # slopes of such lines are one range.
    k = ConvexHull(np.column_stack([np.arange(x.size), x / digit])).vertices
    line = np.column_stack([np.ones(k.size), k])
    sides = np.concatenate([line, -line]), np.concatenate([x[k], -x[k]]) / digit + 0.5
    ends = [linprog((0, sign), *sides, bounds=(None, None)) for sign in (1, -1)]
    if not all(found.success for found in ends):
        return None
    first, last = (float(found.x[1]) * digit for found in ends)
    step = _roundest(first, last)
    if step < _FINEST * digit:
        return None
    if last - first > _SURE * step:
        raise InputError(
            f"the positions are rounded to steps of {digit:g}, which leaves their distance open "
            f"between {first:.4g} and {last:.4g}: give {parameter('columns')} Z, that of the "
            f"heights alone, and {parameter('step')}"
        )
    return step


def _refuse_interleaved(name: str, x: Array, heights: Array) -> None:
    """Refuse positions that are each there equally often, where heights jump between them.

    Rounding makes such positions as well, but the nearest heights are then the most alike.
    """
    times = np.unique(x, return_counts=True)[1]
    often = int(times[0])
    if often == 1 or np.ptp(times):
        return
    rises = (np.abs(heights[lag:] - heights[:-lag]) for lag in (1, often))
    nearest, same_trace = (float(np.nanmedian(rise)) for rise in rises)
    if nearest > _JUMPS * same_trace:
        raise InputError(
            f"every position of {name} is there {often} times, and the heights jump between them: "
            f"keep the rows of one trace (or give {parameter('columns')} Z, that of the heights "
            f"alone, and {parameter('step')}, if the positions are rounded)"
        )


def _printed_digit(x: Array) -> float | None:
    """Return the largest power of ten that all numbers are whole multiples of."""
    for decimals in _DIGITS:
        multiples = x * 10.0**decimals
        whole = np.rint(multiples)
        if whole.any() and np.all(np.abs(multiples - whole) <= 1e-6):
            return float(10.0**-decimals)
    return None


def _roundest(low: float, high: float) -> float:
    """Return the number between two that has the fewest decimals."""
    middle = (low + high) / 2
    # Of numbers with so many decimals the nearest one to the middle lies between, if any does.
    numbers = (round(middle, decimals) for decimals in _DIGITS)
    return next((number for number in numbers if low <= number <= high), middle)
