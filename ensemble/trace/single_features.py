"""Find single crests and troughs that stand far out of all others: a burr, a grain of dust."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adhesis.ensemble.errors import parameter
from adhesis.ensemble.quantities import LENGTH, length_text
from adhesis.solver.model.profile import Array

# The last of up to so many crests exceeds the next one by so many standard deviations of the other
# heights: of 400 self-affine traces each (H = 0.2 … 0.95) in at most 2 (7 with one longest wave).
_MOST, _FAR = 3, 2.5
# A wider feature, as a share of the trace, is a wave of the roughness.
_WIDEST = 0.1


@dataclass(frozen=True)
class Feature:
    """Single crest or trough; positions from the first point of the trace, in m."""

    position: float  # of its top, or of its bottom
    # begin, end: where it begins and ends: three times its width at half height
    begin: float
    end: float
    beyond: float  # height above all other crests, or depth below all other troughs, in m
    rms: float  # root mean square of the other heights, in m
    is_crest: bool

    @property
    def warning(self) -> str:
        """Say where it is, what it does, and how it is left out."""
        place, size = length_text(self.position, 4), length_text(self.beyond)
        rest = f"others, which are {length_text(self.rms)} rms"
        option = excluding(self.begin, self.end)
        if self.is_crest:
            return (
                f"a single crest at {place} stands {size} above all {rest}: it "
                "is touched first and may carry the contact alone; if it is dust or the burr of a "
                f"scratch, leave it out: {option}"
            )
        return (
            f"a single trough at {place} lies {size} below all {rest}: it is "
            "hardly touched, but counts in rms height and form; if it is a scratch or a fault of "
            f"the measurement, leave it out: {option}"
        )


def single_features_text(features: Sequence[Feature]) -> str:
    """Describe features by their places: "crest at 1.24 mm, trough at 0.3 mm"."""
    return ", ".join(
        f"{'crest' if feature.is_crest else 'trough'} at {length_text(feature.position, 4)}"
        for feature in features
    )


def excluding(begin: float, end: float) -> str:
    """Return the option, or the argument, that excludes a range, rounded outwards."""
    unit = LENGTH.unit_for(end)
    size = LENGTH.units[unit]
    places = max(0, math.ceil(-math.log10((end - begin) / size / 10)))
    scale = 10.0**places
    low = math.floor(begin / size * scale + 1e-6) / scale
    high = math.ceil(end / size * scale - 1e-6) / scale
    name = parameter("exclude")
    if name == "exclude":
        return f"exclude=[({low * size:.{places + 4}g}, {high * size:.{places + 4}g})]"
    short = unit.replace("µ", "u")
    return f"{name} {low:.{places}f}{short}:{high:.{places}f}{short}"


def single_features(level: Array, step: float, start: float) -> tuple[Feature, ...]:
    """Find the single crests and troughs of level heights (m), by position.

    ``step`` is in m, ``start`` the position of the first height in the trace, in m.
    """
    found = []
    for sign in (1.0, -1.0):
        for top, low, high, beyond, rms in _outlying(sign * level):
            places = (start + step * top, start + step * low, start + step * (high - 1))
            found.append(Feature(*places, beyond, rms, sign > 0))
    return tuple(sorted(found, key=lambda feature: feature.position))


def _outlying(level: Array) -> list[tuple[int, int, int, float, float]]:
    """Return top, range and distance of the crests before the last large distance of two."""
    rest = np.ones(level.size, dtype=bool)
    crests: list[tuple[int, int, int]] = []
    outlying: list[tuple[int, int, int, float, float]] = []
    while True:
        top, low, high = _highest(level, rest)
        next_height = level[top]
        rms = float(np.std(level[rest]))
        if crests and level[crests[-1][0]] - next_height > _FAR * rms:
            outlying = [(*crest, float(level[crest[0]] - next_height), rms) for crest in crests]
        if len(crests) == _MOST or high - low > _WIDEST * level.size:
            return outlying
        crests.append((top, low, high))
        rest[low:high] = False


def _highest(level: Array, rest: Array) -> tuple[int, int, int]:
    """Return the highest of the other heights, and three times its width at half height."""
    top = int(np.argmax(np.where(rest, level, -np.inf)))
    below = np.flatnonzero(level <= 0.5 * (level[top] + float(np.median(level[rest]))))
    after = int(np.searchsorted(below, top))
    low = int(below[after - 1]) + 1 if after else 0
    high = int(below[after]) if after < below.size else level.size
    width = high - low
    return top, max(low - width, 0), min(high + width, level.size)
