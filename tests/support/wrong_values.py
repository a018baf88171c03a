"""Numbers that break a rule, made from its bounds; numbers with units."""

import math
from collections.abc import Iterator

import numpy as np

from adhesis.solver.checks import Bounds


class WithUnit(np.ndarray):
    """An array with a unit, as unyt and astropy have them."""

    units = "um"


class FloatWithUnit(float):
    """A number with a unit."""

    units = "um"


def outside(bounds: Bounds) -> Iterator[float]:
    """Numbers next to the bounds and far beyond them, those that are none, and parts of one."""
    yield from (math.nan, -math.inf)
    if not bounds.or_infinite:
        yield math.inf
    for end, excluded, away in (
        (bounds.low, bounds.without_low, -math.inf),
        (bounds.high, bounds.without_high, math.inf),
    ):
        if math.isfinite(end):
            beyond = end + math.copysign(1, away) if bounds.whole else math.nextafter(end, away)
            found = {end if excluded else beyond, math.copysign(2 * abs(end) + 1, away)}
            # 0 may be allowed although numbers near it are not
            yield from sorted(number for number in found if not bounds.holds(number))
    if bounds.whole:
        yield 1.5
