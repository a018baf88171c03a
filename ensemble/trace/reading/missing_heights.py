"""Find missing heights: numbers that instruments write for them, and rows that a column marks."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from adhesis.solver.checks import counted
from adhesis.solver.model.profile import Array

# A height that lies this many ranges of all usual heights outside them, and is repeated, stands for
# a missing one. For numbers that instruments are known to write the second value holds, and once is
# enough.
_BEYOND, _BEYOND_KNOWN = 5.0, 0.2
_REPEATED = 3
_ALIKE = 2e-3  # codes beside each other differ by less than this share of them: -99.9999, -99.9998
_MOST_CODES = 4  # of one instrument; more different numbers are heights, as of a sine
_CODES = (9999, 99999, 999999, 9999999, 32767, 32768, 65535, 2147483647, 2147483648)
_ENORMOUS = 1e20
_NINES = re.compile(r"-?9{2,}\.?9+")
_BEGINS = re.compile(r"-?(9\.?){3}")  # as codes beside each other do, but no floor at -10 or -20
# The name of a column that marks which heights are valid
VALID = re.compile(
    r"\W*((is|z|data)?[ _]?valid(ity)?|v[aá]lid[aeo]|gültig|ok|good|有効|有效|유효)(\b|_)", re.I
)


def may_be_code(value: float) -> bool:
    """Return whether a number may stand for a missing height: a known code, or nines alone."""
    return is_known_code(value) or bool(_NINES.fullmatch(f"{value:g}"))


def is_known_code(value: float) -> bool:
    """Return whether instruments write this number for a missing height."""
    size = abs(value)
    return size >= _ENORMOUS or (size > 9997 and any(abs(size - code) <= 1.0 for code in _CODES))


def without_codes(heights: Array, *, known_alone: bool = False) -> tuple[Array, str]:
    """Replace numbers that stand for missing heights by NaN; return heights and a description.

    ``known_alone``: only those that instruments write, beyond the range of all others.
    """
    heights = np.where(np.isfinite(heights), heights, np.nan) + 0.0  # no sign of a nought
    values, times = np.unique(heights[np.isfinite(heights)], return_counts=True)
    known = np.array([is_known_code(value) for value in values], dtype=bool)
    nines = np.array([bool(_NINES.fullmatch(f"{value:g}")) for value in values], dtype=bool)
    repeated = times >= _REPEATED
    on_both_sides = np.isin(-values, values)
    likely = known | (nines & (repeated | on_both_sides))
    if (~likely).sum() < 2:
        return heights, ""
    low, high = _usual(values[~likely])
    away = np.maximum(low - values, values - high)
    are_single = float(np.median(times)) == 1.0
    gaps = np.diff(values)
    begin = np.array([bool(_BEGINS.match(f"{value:.12g}")) for value in values], dtype=bool)
    alike = begin[1:] & begin[:-1] & (gaps < _ALIKE * np.abs(values[1:]))
    gaps[are_single & alike] = np.inf
    apart = np.minimum(np.append(np.inf, gaps), np.append(gaps, np.inf))
    far = (away > _BEYOND * (high - low)) & (apart > _BEYOND_KNOWN * (high - low))
    far &= repeated | nines | on_both_sides
    # Where hardly a height occurs twice, a number that does stands for no height if all others lie
    # within a smaller range than it is apart from them; so do noughts and nines, more often than
    # all others, even within the range.
    ends, rest = np.flatnonzero(~likely)[[0, -1]], values[~likely]
    far[ends] |= are_single & repeated[ends] & (apart[ends] > abs(rest[-2] - rest[1]))
    far &= far.sum() <= _MOST_CODES
    repeated &= times > times[~likely & (values != 0)].max()
    codes = (known if known_alone else likely) & (away > _BEYOND_KNOWN * (high - low))
    if not known_alone:
        codes |= far | ((nines | (values == 0)) & repeated & are_single)
        codes |= nines & np.isin(-values, values[codes])
    if not codes.any():
        return heights, ""
    shown = ", ".join(f"{value:.10g}" for value in values[codes][:4])
    return (
        np.where(np.isin(heights, values[codes]), np.nan, heights),
        f"{counted(int(times[codes].sum()), 'height')} of {shown}",
    )


def _usual(values: Array) -> tuple[float, float]:
    """Return the range of the usual ones of different heights, in ascending order.

    It grows from the middle half of them, as long as more lie within _BEYOND times its width.
    """
    low, high = (float(values[int(part * (values.size - 1))]) for part in (0.25, 0.75))
    if low == high:
        return float(values[0]), float(values[-1])
    while True:
        reach = _BEYOND * (high - low)
        inside = values[(values >= low - reach) & (values <= high + reach)]
        if inside[0] == low and inside[-1] == high:
            return low, high
        low, high = float(inside[0]), float(inside[-1])


def invalid_rows(
    columns: Array, fields: Sequence[Sequence[str]], chosen: Sequence[int]
) -> tuple[Array, list[str]]:
    """Return which rows a column named "valid" marks with nought, and descriptions.

    Other columns beside the chosen ones that hold few numbers alone are described, and those that
    rise or fall throughout.
    """
    marked = np.zeros(columns.shape[1], dtype=bool)
    notes = []
    for k, column in enumerate(columns):
        numbers = np.unique(column[np.isfinite(column)])
        held = [f"{number:g}" for number in numbers[: _MOST_CODES + 1]]
        held += ["empty fields"] * bool(len(held) == 1 and np.isnan(column).any())
        if k in chosen or len(held) < 2:
            continue
        steps, has_two = np.diff(column), len(held) == 2
        names = [row[k] for row in fields if row[k]]
        name = f"column {k + 1} ({names[0]})" if names else f"column {k + 1}"
        if np.all(steps > 0) or np.all(steps < 0):
            step = abs(np.median(steps))
            notes.append(
                f"{name} has steps of {step:g}, as positions or a count do: it is not used"
            )
        elif (
            any(map(VALID.match, names))
            and numbers[0] <= 0 < numbers[-1]
            and (has_two or numbers[0] == 0)
        ):
            marked |= column <= 0
            count = counted(int((column <= 0).sum()), "height")
            notes.append(f"{count} marked {held[0]} in {name} taken as drop-outs")
        elif len(held) <= _MOST_CODES:
            notes.append(f"{name} holds {' and '.join(held)} alone: it is not used")
    return marked, notes
