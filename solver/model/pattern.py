"""Work of adhesion that varies along the rigid profile."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.checks import FINITE, HARMONIC, SHARE, finite_row, real, whole
from adhesis.solver.model.profile import EQUAL_CRESTS, MIRRORED, Array, Profile
from adhesis.solver.values import ByValue


@dataclass(frozen=True, eq=False, repr=False)
class AdhesionPattern(ByValue):
    """Variation of the work of adhesion along one period of a profile, about its mean γ.

    ::

        γ(x)/γ = 1 + Σ_m c_m exp(i m q0 x),   c_-m = conj(c_m),   c_0 = 0

    It belongs to the rigid profile: where the soft solid slides along it, γ(x) stays behind
    (docs/work-of-adhesion.md). Two patterns are equal if all their coefficients are.

    Parameters
    ----------
    coefficients : complex array, shape (M + 1,)
        c_0 … c_M, dimensionless, as those of a :class:`Profile`: an amplitude ε of wave m is
        |c_m| = ε/2. Those of values at x_j = j λ/n are their ``numpy.fft.rfft`` over n and over
        their mean, with c_0 set to 0.

    Raises
    ------
    ValueError
        If c_0 is not 0, a coefficient is not finite, or γ(x) is not positive everywhere.
    TypeError
        If the coefficients are not a row of numbers.

    Examples
    --------
    >>> import numpy as np
    >>> pattern = AdhesionPattern([0, 0.25])
    >>> pattern.at(np.array([0.0, np.pi]))
    array([1.5, 0.5])
    >>> pattern == stripes(1, 0.5)
    True
    """

    coefficients: NDArray[np.complex128]

    def __post_init__(self) -> None:
        given = self.coefficients
        c = finite_row("pattern coefficients", given, entry="coefficient", imaginary=True)
        if c.size and c[0] != 0:
            raise ValueError(f"c_0 of a pattern is {c[0]}: it must be 0, as γ is the mean")
        object.__setattr__(self, "coefficients", c)
        super().__post_init__()
        if not self.least > 0:
            raise ValueError(
                f"the pattern lowers the work of adhesion to {self.least:.4g} of its mean: it must "
                "stay positive along the whole period"
            )

    @cached_property
    def _variation(self) -> Profile | None:
        """γ(x)/γ - 1 as a profile over θ, or None where nothing varies."""
        return Profile(2 * np.pi, self.coefficients) if self.coefficients.any() else None

    @cached_property
    def least(self) -> float:
        """Least γ(x)/γ."""
        return 1.0 - self._variation.scaled(-1.0).h_max if self._variation else 1.0

    @cached_property
    def largest(self) -> float:
        """Largest γ(x)/γ."""
        return 1.0 + self._variation.h_max if self._variation else 1.0

    @property
    def highest_harmonic(self) -> int:
        """Largest m with c_m ≠ 0; 0 where nothing varies."""
        return self._variation.highest_harmonic if self._variation else 0

    @property
    def stripes(self) -> tuple[int | None, float | None, float | None]:
        """The arguments of :func:`stripes` that make it; None where it is not one wave."""
        waves = np.flatnonzero(self.coefficients)
        if len(waves) != 1:
            return None, None, None
        (wave,) = waves.tolist()
        c = self.coefficients[wave]
        return wave, float(2 * np.abs(c)), float(np.angle(c))

    def at(self, theta: Array) -> Array:
        """Evaluate γ(x)/γ at θ = q0 x."""
        return 1.0 + self._variation.at(theta) if self._variation else np.ones_like(theta)

    def equal_parts(self, of_profile: int) -> int:
        """Number of equal parts of a period whose profile has so many of them."""
        waves = np.flatnonzero(np.abs(self.coefficients) > EQUAL_CRESTS)
        return int(np.gcd.reduce(np.append(waves, of_profile)))

    def is_mirrored(self, theta: Array) -> NDArray[np.bool_]:
        """Whether γ(x) is nearly its own mirror image about each of these places."""
        turn = np.exp(1j * np.multiply.outer(theta, np.arange(self.coefficients.size)))
        odd = np.abs(np.imag(self.coefficients * turn)).max(axis=-1)
        return np.asarray(odd < MIRRORED)

    def shifted(self, share: float) -> AdhesionPattern:
        """Return the pattern moved by a ``share`` of the period towards positive x."""
        turn = np.exp(-2j * np.pi * np.arange(self.coefficients.size) * real("share", share))
        return AdhesionPattern(self.coefficients * turn)

    def on_period(self, ratio: float) -> AdhesionPattern:
        """Return waves of these lengths on a period ``ratio`` times as long, in whole numbers."""
        waves = np.flatnonzero(self.coefficients)
        others = np.rint(waves * ratio).astype(int).clip(1)
        coefficients = np.zeros(others.max(initial=0) + 1, dtype=np.complex128)
        np.add.at(coefficients, others, self.coefficients[waves])
        return AdhesionPattern(coefficients)

    def mirrored(self) -> AdhesionPattern:
        """Return the pattern γ(-x)."""
        return AdhesionPattern(np.conj(self.coefficients))


def stripes(count: int, amplitude: float, phase: float = 0.0) -> AdhesionPattern:
    """Make the pattern γ(x) = γ (1 + ε cos(n q0 x + φ)) (docs/work-of-adhesion.md).

    Parameters
    ----------
    count : int
        n, stripes of the larger γ in a period, from 1.
    amplitude : float
        ε, dimensionless, from 0 to 1, which is excluded.
    phase : float
        φ in rad, dimensionless: 0 for a stripe of the largest γ about x = 0.

    Raises
    ------
    ValueError, TypeError
        If one of them breaks these rules.

    Examples
    --------
    >>> from adhesis import stripes
    >>> pattern = stripes(4, amplitude=0.3)
    >>> round(pattern.least, 9), round(pattern.largest, 9)
    (0.7, 1.3)
    """
    coefficients = np.zeros(whole("count", count, HARMONIC) + 1, dtype=np.complex128)
    phase = real("phase", phase, FINITE)
    coefficients[-1] = 0.5 * real("amplitude", amplitude, SHARE) * np.exp(1j * phase)
    return AdhesionPattern(coefficients)


def stripes_of(
    count: int | None, amplitude: float | None, phase: float | None
) -> AdhesionPattern | None:
    """Make the stripes of options, or None where neither number nor amplitude is given.

    Raises
    ------
    ValueError
        If only one of them is, or a phase alone.
    """
    if count is None and amplitude is None and not phase:
        return None
    if count is None or amplitude is None:
        missing = "stripes" if count is None else "stripe_amplitude"
        raise ValueError(
            f"{missing} is missing: give the number of stripes and their amplitude together, and a "
            "phase only beside both"
        )
    return stripes(count, amplitude, phase or 0.0)
