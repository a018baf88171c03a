"""Choose the crack that opens a patch from inside, where tension reaches the strength.

With adhesion of zero range a gap inside a patch grows only beyond a length. On a flat piece under a
uniform tension σ that is the length of Griffith's crack,

    l = 4 E*γ/(πσ²),

from which on G = K²/(2E*) exceeds γ, K² = πσ²l/2. Up to there the energy rises by γl/2: a barrier,
which an interface of finite range does not have.

The shortest crack is put into a patch whose G exceeds γ by a tenth at both tips, so that it grows.
G is that of the field with the crack, all other edges being held: other gaps and the control change
it, and so does a tension that falls away from its maximum. Both conditions have to hold, strength
and growth, as in finite fracture mechanics (D. Leguillon, Eur. J. Mech. A 21, 61, 2002). Where no
crack that fits grows, tension is so peaked that an interface would only yield there, and nothing
opens.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

GROWTH = 1.1
"""G/γ of the crack that is put into a patch."""
LONGEST_TRIAL_HALF_LENGTH = 0.25
"""Half-length of the longest crack, in shortest waves: it is then as long as half a wave."""
IN_PATCH = 0.8
"""Half-length of the longest crack, over the distance of its middle from the nearest edge."""
EQUAL_TENSIONS = 1e-4
"""Maxima of tension that differ by less, in units of the strength, open together."""
NEAR_STRENGTH = 0.8
"""Smaller maxima of tension, in units of the strength, are not judged."""
MOST_MAXIMA = 32
"""Maxima of tension of one field that are refined."""
MOST_OPENINGS = 1000
"""Openings one after the other at one prescribed value; more are an endless loop."""

_RATIO = 1.1  # of the lengths of cracks that are tried one after the other


@dataclass(frozen=True)
class Crack:
    """A maximum of tension inside a patch, and the crack that can be put there.

    Lengths in the units in which the maximum was given.

    Attributes
    ----------
    position : float
    tension : float
        In units of the strength.
    value : float
        Margin before it opens, in units of the strength; not positive if it opens.
    length : float
        Of the crack; 0 if it does not open.
    barrier : float
        Energy per unit depth from the closed patch up to the crack at which G = γ, in units of γ
        times the unit of length.
    """

    position: float
    tension: float
    value: float
    length: float = 0.0
    barrier: float = 0.0


def griffith_length(tension: float, modulus: float, work_of_adhesion: float) -> float:
    """Compute the length in m of the crack that is in equilibrium under a uniform tension in Pa."""
    return 4 * modulus * work_of_adhesion / (math.pi * tension**2)


def judge_maximum(
    position: float,
    tension: float,
    strength: float,
    balanced: float,
    toughness: float,
    release: Callable[[float], float],
    shortest: float,
    longest: float,
) -> Crack:
    """Judge whether a patch opens at a maximum of tension, and with which crack.

    Parameters
    ----------
    position, tension : float
        Of the maximum.
    strength : float
        In the same units.
    balanced : float
        a σ² at which G = γ there, under a uniform tension.
    toughness : float
        sqrt(1 + h'²) there: γ of a unit of length.
    release : callable
        Returns G/γ of the crack of a half-length, the smaller of those at its two tips.
    shortest, longest : float
        Least and largest half-length of a crack.
    """
    share = tension / strength
    first = max(shortest, GROWTH * balanced / tension**2)
    if share < 1:
        return Crack(position, share, 1 - share)
    if first > longest:
        return Crack(position, share, first / longest - 1)
    half, rate = [0.0], [0.0]
    # G rises with the length up to where tension falls, or the crack takes part of the mean gap
    while first <= longest and rate[-1] == max(rate) < GROWTH * share**2:
        half.append(first)
        rate.append(release(first))
        first *= _RATIO
    value = max(1 - share, 1 - math.sqrt(max(rate) / GROWTH))
    if value > 0:
        return Crack(position, share, value)
    grows = int(np.argmax(np.array(rate) >= GROWTH))
    barrier = toughness * _barrier(half[: grows + 1], rate[: grows + 1])
    return Crack(position, share, value, 2 * half[grows], barrier)


def _barrier(half: list[float], rate: list[float]) -> float:
    """Integrate 2(1 - G/γ) over the half-length of a crack, up to that at which G = γ."""
    last = int(np.argmax(np.array(rate) >= 1))
    share = (1 - rate[last - 1]) / (rate[last] - rate[last - 1])
    lengths = [*half[:last], half[last - 1] + share * (half[last] - half[last - 1])]
    return 2 * float(np.trapezoid([1 - g for g in rate[:last]] + [0.0], lengths))


def largest_excess(cracks: list[Crack]) -> list[Crack]:
    """Return the crack that opens first, and those that equal it; none if none opens."""
    least = min((crack.value for crack in cracks), default=1.0)
    return [crack for crack in cracks if crack.value <= min(least + EQUAL_TENSIONS, 0.0)]
