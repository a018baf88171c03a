"""Crack that opens a patch from inside, where the tension of an interface reaches its strength.

With adhesion of zero range a gap inside a patch grows only beyond a length. On a flat piece under a
uniform tension σ that is the length of Griffith's crack,

    l = 4 E*γ/(πσ²),

from which on G = K²/(2E*) exceeds γ, K² = πσ²l/2. Up to there the energy rises by γl/2: a barrier,
which an interface of finite range does not have. Where tension falls away from its maximum, K of a
crack of the half-length a is that of the mean of σ over its angle φ, x = a cos φ from its middle
(:func:`release_rate`).

Put into a patch is the shortest crack whose G exceeds γ by a tenth, so that it surely grows. Both
conditions have to hold, strength and growth, as in finite fracture mechanics (D. Leguillon, Eur. J.
Mech. A 21, 61, 2002). Where no crack that fits grows, tension is so peaked that an interface would
only yield there, and nothing opens.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from adhesis.solver.model.profile import Array

GROWTH = 1.1
"""G/γ of the crack that is put into a patch."""
LONGEST = 0.25
"""Half-length of the longest crack, in shortest waves: it is then as long as half a wave."""
IN_PATCH = 0.8
"""Half-length of the longest crack, over the distance of its middle from the nearest edge."""
EQUAL_TENSIONS = 1e-4
"""Maxima of tension that differ by less, in units of the strength, open together."""
NEAR_STRENGTH = 0.8
"""Smaller maxima of tension, in units of the strength, are not judged."""
HEALED_TENSION = 1.01
"""A crack that closed again is tried again from this multiple of its tension on."""

_RATIO = 1.1  # of the lengths of cracks that are tried one after the other
_NODES = 12  # places of a crack at which the tension of the unbroken patch is taken
_COSINES = np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)


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
        What is left before it opens, in units of the strength: not positive when it is time.
    length : float
        Of the crack; 0 where none is known.
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


def release_rate(half: Array, tension_at: Callable[[Array], Array], position: float) -> Array:
    """Compute a σ̄(a)² of cracks in the tension of an unbroken patch: G over π/(2E*).

    Parameters
    ----------
    half : array
        Half-lengths a.
    tension_at : callable
        Tension at some places.
    position : float
        Middle of the cracks.
    """
    places = position + np.multiply.outer(half, _COSINES)
    mean = tension_at(places.ravel()).reshape(places.shape).mean(axis=1)
    return np.asarray(half * np.maximum(mean, 0.0) ** 2)


def judge_maximum(
    position: float,
    tension: float,
    strength: float,
    balanced: float,
    toughness: float,
    tension_at: Callable[[Array], Array],
    shortest: float,
    longest: float,
) -> Crack:
    """Judge a maximum of tension inside a patch: whether it opens, and with which crack.

    Parameters
    ----------
    position, tension : float
        Of the maximum.
    strength : float
        In the same units.
    balanced : float
        a σ² at which G = γ there.
    toughness : float
        sqrt(1 + h'²) there: γ of a unit of length.
    tension_at : callable
        Tension at other places of the patch.
    shortest, longest : float
        Half-lengths between which a crack is looked for.
    """
    share = tension / strength
    griffith = balanced / tension**2
    first = max(shortest, GROWTH * griffith)
    if share < 1:
        return Crack(position, share, 1 - share)
    if first > longest:
        return Crack(position, share, first / longest - 1)

    def release(half: Array) -> Array:
        return release_rate(half, tension_at, position) / balanced

    steps = int(np.log(longest / first) / np.log(_RATIO))
    half = np.asarray(first * _RATIO ** np.arange(steps + 1), dtype=np.float64)
    found = release(half)
    grows = np.flatnonzero(found >= GROWTH)
    if not grows.size:
        return Crack(position, share, 1 - math.sqrt(found.max() / GROWTH))
    end = float(half[grows[0]])
    # up to the half-length at which G = γ
    steps = max(int(np.log(end / griffith) / np.log(_RATIO)), 0)
    half = np.append(griffith * _RATIO ** np.arange(steps + 1), end)
    balance = float(half[np.argmax(release(half) >= 1)])
    way: Array = balance * np.linspace(0, 1, _NODES + 1)
    barrier = 2 * toughness * float(np.trapezoid(1 - release(way), way))
    return Crack(position, share, 1 - share, 2 * end, barrier)


def largest_excess(cracks: list[Crack]) -> list[Crack]:
    """Return the crack that opens first, and those that equal it; none if none is to open."""
    least = min((crack.value for crack in cracks), default=1.0)
    return [crack for crack in cracks if crack.value <= min(least + EQUAL_TENSIONS, 0.0)]


def has_healed(crack: Crack, healed: list[Crack], near: float, period: float) -> bool:
    """Whether a crack closed again within ``near`` of this one, at hardly a smaller tension."""
    for other in healed:
        apart = (crack.position - other.position + period / 2) % period - period / 2
        if abs(apart) < near and crack.tension < HEALED_TENSION * other.tension:
            return True
    return False
