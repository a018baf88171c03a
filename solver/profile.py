"""Rough periodic profiles: the spectral method, given heights, and their statistics.

A profile is a band-limited real function of period λ, held as its Fourier coefficients

    h(x) = Σ_m a_m exp(i m q0 x),   q0 = 2π/λ,   a_-m = conj(a_m),   a_0 = 0,

so that it is the same function on every grid: a finer grid adds nodes, never roughness.
Lengths in m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Amplitudes = Literal["deterministic", "rayleigh"]

# Beyond this, memory is measured in gigabytes; loops have been tested to a tenth of it.
MOST_WAVES = 100_000

# Nodes per shortest wave of the sampling that brackets every crest before Newton's iteration.
_CREST_SAMPLING = 16
_CREST_SWEEPS = 60

EQUAL_CRESTS = 1e-9
"""Crests whose heights differ by less than this share of h_max are equal: they touch together."""


@dataclass(frozen=True, eq=False)
class Crests:
    """Crests of a profile, in the order of x; arrays of shape (crests,).

    Attributes
    ----------
    position, height : array
        In m.
    curvature : array
        -h'' in 1/m, positive.
    """

    position: Array
    height: Array
    curvature: Array


@dataclass(frozen=True, eq=False)
class Profile:
    """One period of a rigid profile with zero mean, pointing towards the elastic solid.

    Parameters
    ----------
    period : float
        λ, in m, positive.
    coefficients : complex array, shape (M + 1,)
        a_0 … a_M in m; ``coefficients[m]`` belongs to the wave number m q0. a_0 must be zero.

    Raises
    ------
    ValueError
        If the period is not positive and finite, or a coefficient is not finite, or a_0 is not 0.

    References
    ----------
    docs/theory.md, "2. Profiles"; moments after Nayak, J. Lubr. Technol. 93, 398 (1971)
    """

    period: float
    coefficients: NDArray[np.complex128]

    def __post_init__(self) -> None:
        if not (np.isfinite(self.period) and self.period > 0):
            raise ValueError(f"period is {self.period!r}: it must be positive and finite, in m")
        a = np.array(self.coefficients, dtype=np.complex128)
        if a.ndim != 1 or a.size < 2:
            raise ValueError(
                f"a profile has the coefficients a_0 … a_M, M ≥ 1; these have shape {a.shape}"
            )
        if not np.all(np.isfinite(a)):
            raise ValueError("every coefficient of a profile must be finite")
        if a[0] != 0:
            raise ValueError(f"a_0 is {a[0]}: a profile has zero mean, so a_0 must be 0")
        a.setflags(write=False)
        object.__setattr__(self, "coefficients", a)

    # ------------------------------------------------------------------ wave numbers

    @property
    def q0(self) -> float:
        """Fundamental wave number 2π/λ, in rad/m."""
        return 2 * np.pi / self.period

    @cached_property
    def highest_harmonic(self) -> int:
        """Largest m with a_m ≠ 0; 0 for a flat profile."""
        present = np.flatnonzero(self.coefficients)
        return int(present[-1]) if present.size else 0

    @property
    def shortest_wavelength(self) -> float:
        """λ_min = λ / (highest harmonic), in m; the period for a flat profile."""
        return self.period / max(self.highest_harmonic, 1)

    @property
    def is_flat(self) -> bool:
        """Whether every coefficient is zero."""
        return self.highest_harmonic == 0

    # ------------------------------------------------------------------ values

    def heights(self, n: int) -> Array:
        """Heights h at x_j = j λ/n, shape (n,), in m.

        Raises
        ------
        ValueError
            If the grid cannot carry the shortest wave (n must exceed twice the highest harmonic).
        """
        return self._sample(self.coefficients, n)

    def slopes(self, n: int) -> Array:
        """Slopes h' at x_j = j λ/n, shape (n,), dimensionless."""
        return self._sample(self.coefficients * self._iq(1), n)

    def curvatures(self, n: int) -> Array:
        """Second derivative h'' at x_j = j λ/n, shape (n,), in 1/m."""
        return self._sample(self.coefficients * self._iq(2), n)

    def at(self, x: Array | float, derivative: int = 0) -> Array:
        """Height (or its derivative of the given order) at any x in m, exactly; cost M per point.

        Returns an array of the shape of ``x``, in m^(1 - derivative).
        """
        x = np.asarray(x, dtype=float)
        m = np.flatnonzero(self.coefficients)
        a = 2 * (self.coefficients * self._iq(derivative))[m]
        phase = np.multiply.outer(x * self.q0, m)
        return np.asarray(np.cos(phase) @ a.real - np.sin(phase) @ a.imag)

    def _iq(self, power: int) -> NDArray[np.complex128]:
        powers: NDArray[np.complex128] = np.power(
            1j * self.q0 * np.arange(self.coefficients.size), power
        )
        return powers

    def _sample(self, a: NDArray[np.complex128], n: int) -> Array:
        if n <= 2 * self.highest_harmonic:
            raise ValueError(
                f"{n} nodes are too few: the shortest wave has harmonic {self.highest_harmonic}, "
                f"so more than {2 * self.highest_harmonic} nodes are needed"
            )
        spectrum = np.zeros(n // 2 + 1, dtype=np.complex128)
        stop = self.highest_harmonic + 1
        spectrum[:stop] = a[:stop]
        return np.asarray(np.fft.irfft(spectrum, n) * n)

    # ------------------------------------------------------------------ statistics

    def moment(self, order: int) -> float:
        """Spectral moment m_k = Σ_m (m q0)^k |a_m|² over both signs of m, in m^(2-k).

        m0 is the mean square height, m2 the mean square slope, m4 the mean square curvature
        (Nayak 1971).
        """
        q = self.q0 * np.arange(self.coefficients.size)
        return float(2 * np.sum(q**order * np.abs(self.coefficients) ** 2))

    @property
    def m0(self) -> float:
        """Mean square height, in m²."""
        return self.moment(0)

    @property
    def m2(self) -> float:
        """Mean square slope, dimensionless."""
        return self.moment(2)

    @property
    def m4(self) -> float:
        """Mean square curvature, in 1/m²."""
        return self.moment(4)

    @property
    def h_rms(self) -> float:
        """Root mean square height, in m."""
        return float(np.sqrt(self.m0))

    def crests(self, within: float = EQUAL_CRESTS) -> Crests:
        """Crests of the continuous function whose height is at least (1 - within) h_max.

        Found between nodes by Newton's iteration, so they depend on no grid. A flat profile has
        none.

        Parameters
        ----------
        within : float
            Share of h_max, not negative.
        """
        if self.is_flat:
            return Crests(*np.empty((3, 0)))
        n = _CREST_SAMPLING * 2 * self.highest_harmonic
        dx = self.period / n
        h = self.heights(n)
        crest = (h >= np.roll(h, 1)) & (h > np.roll(h, -1))
        # A crest between nodes rises at most about dx² |h''|/8 above its highest node.
        spread = dx**2 * float(np.max(np.abs(self.curvatures(n))))
        near = np.flatnonzero(crest & (h >= (1 - within) * h.max() - spread))
        x: Array = np.asarray(near * dx, dtype=np.float64)
        for sweep in range(_CREST_SWEEPS):
            second = self.at(x, 2)
            step = np.where(second < 0, self.at(x, 1) / np.where(second < 0, second, -1.0), 0.0)
            x = x - np.clip(step, -dx, dx)
            # a crest without curvature is approached by a third a step
            if sweep >= 7 and np.abs(step).max() < 1e-9 * dx:
                break
        top = self.at(x)
        high = top >= (1 - within) * top.max()
        x, top = x[high], top[high]
        return Crests(x, top, -self.at(x, 2))

    @cached_property
    def highest_point(self) -> tuple[float, float]:
        """(x, h) of the highest point of the continuous function, in m, independent of any grid."""
        if self.is_flat:
            return 0.0, 0.0
        crests = self.crests(0.0)
        return float(crests.position[0] % self.period), float(crests.height[0])

    @property
    def h_max(self) -> float:
        """Height of the highest point, in m."""
        return self.highest_point[1]

    # ------------------------------------------------------------------ transformations

    def shifted(self, distance: float) -> Profile:
        """Return the profile moved by ``distance`` (m) towards positive x."""
        m = np.arange(self.coefficients.size)
        return Profile(self.period, self.coefficients * np.exp(-1j * m * self.q0 * distance))

    def mirrored(self) -> Profile:
        """Return the profile h(-x)."""
        return Profile(self.period, np.conj(self.coefficients))

    def scaled(self, height: float, length: float = 1.0) -> Profile:
        """Return the profile with heights multiplied by ``height`` and the period by ``length``."""
        return Profile(self.period * length, self.coefficients * height)


def self_affine_profile(
    hurst: float,
    *,
    period: float,
    n0: int,
    ratio: int,
    rolloff: float = 1.0,
    seed: int,
    h_rms: float | None = None,
    m2: float | None = None,
    c0: float | None = None,
    amplitudes: Amplitudes = "deterministic",
) -> Profile:
    """Self-affine profile by the spectral method (Carbone, Pierro & Recchia, arXiv 1511.08891).

    |a_m|² ∝ m^-(2H+1) for n0 ≤ m ≤ ratio·n0, phases uniform on [-π, π). The phase of wave number m
    is the m-th number of the seed's stream, so it depends on neither n0, ratio, H nor the
    normalisation: a wider spectrum keeps the waves it already had.

    Parameters
    ----------
    hurst : float
        Hurst exponent H, 0 < H < 1.
    period : float
        λ in m.
    n0, ratio : int
        Lowest harmonic, and highest over lowest (q_max/q_min), both ≥ 1.
    rolloff : float
        Roll-off over lowest wave number, q_r/q_min, 1 ≤ rolloff ≤ ratio: below it the spectrum is
        flat, as those of real surfaces are (Persson et al. 2005, J. Phys. Condens. Matter 17, R1).
    seed : int
        Non-negative.
    h_rms, m2, c0 : float
        Exactly one of: root mean square height in m; mean square slope; or C0 = |a_n0|² in m².
    amplitudes : {"deterministic", "rayleigh"}
        |a_m| fixed by the power law as in the paper, or Rayleigh distributed about it (a Gaussian
        process); in the latter case h_rms or m2 still hold exactly for every realisation.

    Raises
    ------
    ValueError
        If a value breaks the rules above; the text names the value and the rule.

    References
    ----------
    docs/theory.md, "2. Profiles"; Carbone, Pierro, Recchia, Phys. Rev. E 92, 062404 (2015),
    arXiv 1511.08891
    """
    if not 0 < hurst < 1:
        raise ValueError(f"hurst is {hurst!r}: it must lie between 0 and 1, both excluded")
    for name, value in (("n0", n0), ("ratio", ratio)):
        if value != int(value) or value < 1:
            raise ValueError(f"{name} is {value!r}: it must be a whole number of at least 1")
    if seed != int(seed) or seed < 0:
        raise ValueError(f"seed is {seed!r}: it must be a whole number of at least 0")
    if not 1 <= rolloff <= ratio:
        raise ValueError(f"rolloff is {rolloff!r}: it must lie between 1 and ratio ({ratio})")
    given = {k: v for k, v in {"h_rms": h_rms, "m2": m2, "c0": c0}.items() if v is not None}
    if len(given) != 1:
        raise ValueError(
            f"give exactly one of h_rms, m2 and c0; given: {', '.join(given) or 'none'}"
        )
    (norm, target), *_ = given.items()
    if not (np.isfinite(target) and target >= 0):
        raise ValueError(f"{norm} is {target!r}: it must be finite and not negative")
    if amplitudes not in ("deterministic", "rayleigh"):
        raise ValueError(f"amplitudes is {amplitudes!r}: it must be 'deterministic' or 'rayleigh'")

    top = int(n0) * int(ratio)
    if top > MOST_WAVES:
        raise ValueError(f"n0 · ratio is {top}: at most {MOST_WAVES} waves are supported")
    phase_stream, size_stream = np.random.SeedSequence(int(seed)).spawn(2)
    phase = np.random.default_rng(phase_stream).uniform(-np.pi, np.pi, top)  # wave numbers 1 … top
    m = np.arange(n0, top + 1)
    size = (np.maximum(m / n0, rolloff) / rolloff) ** -(hurst + 0.5)
    if amplitudes == "rayleigh":
        size = size * np.sqrt(np.random.default_rng(size_stream).exponential(size=top))[n0 - 1 :]
    a = np.zeros(top + 1, dtype=np.complex128)
    a[n0:] = size * np.exp(1j * phase[n0 - 1 :])
    unit = Profile(period, a)
    present = {"h_rms": unit.m0, "m2": unit.m2, "c0": 1.0}[norm]
    wanted = target**2 if norm == "h_rms" else target
    return unit.scaled(float(np.sqrt(wanted / present)))


def profile_from_heights(heights: Array, period: float) -> Profile:
    """Band-limited profile through equally spaced heights of one period; the mean is removed.

    Parameters
    ----------
    heights : array, shape (n,), n ≥ 3
        Heights in m at x_j = j λ/n.
    period : float
        λ in m.

    Notes
    -----
    For even n the component at the Nyquist wave number has no phase; it is split evenly between
    both signs, so that the profile passes through every height.

    Raises
    ------
    ValueError
        If the heights are not a one-dimensional array of at least 3 finite numbers.

    References
    ----------
    docs/theory.md, "2. Profiles"
    """
    h = np.asarray(heights, dtype=float)
    if h.ndim != 1:
        raise ValueError(f"heights have {h.ndim} dimensions: one period is one row of numbers")
    if h.size < 3:
        raise ValueError(f"heights hold {h.size} value(s): at least 3 are needed for one period")
    bad = np.flatnonzero(~np.isfinite(h))
    if bad.size:
        raise ValueError(f"heights[{bad[0]}] is {h[bad[0]]}: every height must be a finite number")
    a = np.fft.rfft(h - h.mean()) / h.size
    # Rounding noise is not roughness: a flat or a band-limited input must stay one.
    a[np.abs(a) < 1e-15 * max(float(np.max(np.abs(h))), 1e-300)] = 0
    a[0] = 0
    if h.size % 2 == 0:
        a[-1] = a[-1].real / 2
    return Profile(period, a)


def single_wave(amplitude: float, period: float) -> Profile:
    """Return h = A cos(q0 x): the profile of the exact references.

    Parameters
    ----------
    amplitude : float
        A in m.
    period : float
        λ in m.

    References
    ----------
    docs/theory.md, "2. Profiles"
    """
    return Profile(period, np.array([0.0, amplitude / 2], dtype=np.complex128))
