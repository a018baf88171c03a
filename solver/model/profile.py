"""Generate rough periodic profiles, by the spectral method or from heights, and their statistics.

A profile is a band-limited real function of period λ, held as its Fourier coefficients

    h(x) = Σ_m a_m exp(i m q0 x),   q0 = 2π/λ,   a_-m = conj(a_m),   a_0 = 0,

so that it is the same function on every grid: a finer grid adds nodes, not roughness.
Lengths in m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.checks import (
    COEFFICIENT,
    FINITE,
    HARMONIC,
    HEIGHT,
    HEIGHT_SQUARE,
    HURST,
    LENGTH,
    MEAN_SQUARE_SLOPE,
    MOST_WAVES,
    NODES,
    ROLLOFF,
    SEED,
    Bounds,
    check_index,
    choice,
    finite_row,
    real,
    reals,
    whole,
)
from adhesis.solver.values import ByValue

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Amplitudes = Literal["deterministic", "rayleigh"]

_HEIGHT_OR_NONE = Bounds(0.0, HEIGHT.high, unit="m")
_SHARE = Bounds(0.0, math.inf)
_ORDER = Bounds(0, 16, whole=True)

# Nodes per shortest wave of the sampling that brackets every crest before Newton's iteration.
_CREST_SAMPLING = 16
_CREST_SWEEPS = 60

NORMALISATIONS = {"h_rms": HEIGHT, "m2": MEAN_SQUARE_SLOPE, "c0": HEIGHT_SQUARE}
"""Parameters that scale a self-affine spectrum, with their bounds."""

EQUAL_CRESTS = 1e-9
"""Crests whose heights differ by less than this share of h_max are equal. Waves whose amplitude is
below it make no two parts of a period differ."""

MIRRORED = 1e-6
"""Of h_max, of a pattern of γ: waves may be so far from their mirror image. Jumps are hardly
located more finely."""


@dataclass(frozen=True, eq=False, repr=False)
class Crests(ByValue):
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


@dataclass(frozen=True, eq=False, repr=False)
class Profile(ByValue):
    """One period of a rigid profile with zero mean, pointing towards the elastic solid.

    Immutable; two profiles are equal if their periods and all their coefficients are.

    Parameters
    ----------
    period : float
        λ, in m, from 1e-12 to 1e6.
    coefficients : complex array, shape (M + 1,)
        a_0 … a_M in m; ``coefficients[m]`` belongs to the wave number m q0. a_0 must be zero, and
        at least one other non-zero.

    Raises
    ------
    ValueError
        If the period is out of its bounds, a coefficient is masked or not finite, or a_0 is not 0;
        or the profile is flat: a loop needs a highest point.
    TypeError
        If the period is not a number, or the coefficients are not a row of numbers.

    References
    ----------
    docs/theory.md, "2. Profiles"; moments after Nayak, J. Lubr. Technol. 93, 398 (1971)

    Examples
    --------
    >>> from adhesis import Profile
    >>> round(Profile(1e-3, [0, 0.5e-6]).h_max, 12)  # one wave, of an amplitude of 1 µm
    1e-06
    """

    period: float
    coefficients: NDArray[np.complex128]

    def __post_init__(self) -> None:
        object.__setattr__(self, "period", real("period", self.period, LENGTH))
        a = finite_row("coefficients", self.coefficients, entry="coefficient", imaginary=True)
        if a.size < 2:
            raise ValueError(
                f"a profile has the coefficients a_0 … a_M, M ≥ 1; these have shape {a.shape}"
            )
        if a[0] != 0:
            raise ValueError(f"a_0 is {a[0]}: a profile has zero mean, so a_0 must be 0")
        if not a.any():
            raise ValueError(
                "the profile is flat (h_max = 0): two flat surfaces touch everywhere at once and "
                "a penetration in units of h_max has no meaning"
            )
        real("largest coefficient", float(np.abs(a).max()), COEFFICIENT)
        object.__setattr__(self, "coefficients", a)
        super().__post_init__()

    def __repr__(self) -> str:
        """Return one line with period, waves, heights and slope."""
        return (
            f"Profile(period={self.period:.6g} m, {len(self.coefficients)} coefficients, highest "
            f"harmonic {self.highest_harmonic}, h_rms={self.h_rms:.6g} m, "
            f"rms slope={math.sqrt(self.m2):.6g})"
        )

    # ------------------------------------------------------------------ wave numbers

    @property
    def q0(self) -> float:
        """Fundamental wave number 2π/λ, in rad/m."""
        return 2 * np.pi / self.period

    @cached_property
    def highest_harmonic(self) -> int:
        """Largest m with a_m ≠ 0."""
        return int(np.flatnonzero(self.coefficients)[-1])

    @property
    def shortest_wavelength(self) -> float:
        """λ_min = λ / (highest harmonic), in m."""
        return self.period / self.highest_harmonic

    # ------------------------------------------------------------------ values

    def heights(self, n: int) -> Array:
        """Compute the heights h at x_j = j λ/n, shape (n,), in m.

        Raises
        ------
        ValueError
            If n does not exceed twice the highest harmonic.
        TypeError
            If n is not a number.
        """
        return self._sample(self.coefficients, n)

    def slopes(self, n: int) -> Array:
        """Compute the slopes h' at x_j = j λ/n, shape (n,), dimensionless."""
        return self._sample(self.coefficients * self._iq(1), n)

    def curvatures(self, n: int) -> Array:
        """Compute the second derivative h'' at x_j = j λ/n, shape (n,), in 1/m."""
        return self._sample(self.coefficients * self._iq(2), n)

    def at(self, x: Array | float, derivative: int = 0) -> Array:
        """Evaluate the height (or a derivative) exactly at any x in m; O(M) operations per point.

        Returns an array of the shape of ``x``, in m^(1 - derivative).
        """
        x = reals("x", x)
        derivative = whole("derivative", derivative, _ORDER)
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
        n = whole("n", n, NODES)
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
        """Compute the spectral moment m_k = Σ_m (m q0)^k |a_m|² over both signs of m, in m^(2-k).

        m0 is the mean square height, m2 the mean square slope, m4 the mean square curvature
        (Nayak 1971).
        """
        order = whole("order", order, _ORDER)
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
        """Find the crests of the continuous function not lower than (1 - within) h_max.

        Newton's iteration locates them between nodes, independently of any grid.

        Parameters
        ----------
        within : float
            Share of h_max, not negative.
        """
        within = real("within", within, _SHARE)
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
            # convergence is only linear, with ratio 2/3, to a crest without curvature
            if sweep >= 7 and np.abs(step).max() < 1e-9 * dx:
                break
        top = self.at(x)
        high = top >= (1 - within) * top.max()
        x, top = x[high], top[high]
        return Crests(x, top, -self.at(x, 2))

    @cached_property
    def highest_point(self) -> tuple[float, float]:
        """(x, h) of the highest point of the continuous function, in m, independent of any grid."""
        crests = self.crests(0.0)
        return float(crests.position[0] % self.period), float(crests.height[0])

    @property
    def h_max(self) -> float:
        """Height of the highest point, in m."""
        return self.highest_point[1]

    @cached_property
    def equal_parts(self) -> int:
        """Number of equal parts of the period: the greatest common divisor of its harmonics."""
        return int(np.gcd.reduce(self._harmonics))

    @cached_property
    def mirror_axes(self) -> Array:
        """Places x in m, from 0 to λ/2, about which the profile is nearly its own mirror image."""
        allowed = MIRRORED * self.h_max
        # those of the largest wave: of a small one the phase may be noise
        largest = int(np.abs(self.coefficients).argmax())
        angle = (np.pi * np.arange(largest) - np.angle(self.coefficients[largest])) / largest
        for m in self._harmonics:
            if not len(angle):
                break
            odd = np.imag(self.coefficients[m] * np.exp(1j * m * angle))
            angle = angle[np.abs(odd) < allowed]
        return np.asarray(np.sort(angle % np.pi) / self.q0, dtype=np.float64)

    @cached_property
    def _harmonics(self) -> Integers:
        """Harmonics whose amplitude makes parts of the profile differ, rising."""
        # a wave raises one crest over another by up to four times its coefficient
        return np.flatnonzero(np.abs(self.coefficients) > EQUAL_CRESTS / 4 * self.h_max)

    # ------------------------------------------------------------------ transformations

    def shifted(self, distance: float) -> Profile:
        """Return the profile moved by ``distance`` (m) towards positive x."""
        distance = real("distance", distance)
        m = np.arange(self.coefficients.size)
        return Profile(self.period, self.coefficients * np.exp(-1j * m * self.q0 * distance))

    def mirrored(self) -> Profile:
        """Return the profile h(-x)."""
        return Profile(self.period, np.conj(self.coefficients))

    def scaled(self, height: float, length: float = 1.0) -> Profile:
        """Return the profile with heights multiplied by ``height`` and the period by ``length``."""
        height, length = real("height", height), real("length", length)
        return Profile(self.period * length, self.coefficients * height)


def first_of_equal(
    position: Array, origin: float, part: float, period: float, near: float
) -> NDArray[np.intp]:
    """Choose, of places where contact may begin alike, those where it does begin.

    That is the first to the right of the first crest, with its copies in the other equal parts of
    the period. The rest are its mirror images, or equal it by chance: in any other profile one of
    them comes first, however little they differ. Returned are the indices of the places.

    ``origin`` is the first crest, ``part`` and ``period`` are the lengths of one of the equal
    parts and of all, and ``near`` is the largest error of the positions, all in one unit.
    """
    away = (position - origin + near) % period
    apart = (position - position[np.argmin(away)] + 0.5 * part) % part - 0.5 * part
    return np.flatnonzero(np.abs(apart) <= near)


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
    """Generate a self-affine profile by the spectral method (Carbone et al., arXiv 1511.08891).

    |a_m|² ∝ m^-(2H+1) for n0 ≤ m ≤ ratio·n0, phases uniform on [-π, π). The phase of wave number m
    is the m-th number of the seed's stream, so it does not depend on n0, ratio, H or the
    normalisation: a wider spectrum keeps the phases of the narrower one.

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
        Exactly one of: root mean square height in m; mean square slope; or C0 = |a_n0|² in m²;
        positive.
    amplitudes : {"deterministic", "rayleigh"}
        |a_m| fixed by the power law as in the paper, or Rayleigh distributed about it (a Gaussian
        process); h_rms or m2 then still hold exactly for every realisation.

    Raises
    ------
    ValueError
        If a value breaks the rules above.
    TypeError
        If a value is not a number.

    References
    ----------
    docs/theory.md, "2. Profiles"; Carbone, Pierro, Recchia, Phys. Rev. E 92, 062404 (2015),
    arXiv 1511.08891

    Examples
    --------
    >>> from adhesis import self_affine_profile
    >>> profile = self_affine_profile(0.8, period=1e-3, n0=4, ratio=16, seed=1, h_rms=1e-6)
    >>> round(profile.h_rms, 12), profile.highest_harmonic
    (1e-06, 64)
    """
    hurst, period = real("hurst", hurst, HURST), real("period", period, LENGTH)
    n0, ratio = whole("n0", n0, HARMONIC), whole("ratio", ratio, HARMONIC)
    seed = whole("seed", seed, SEED)
    rolloff = real("rolloff", rolloff, ROLLOFF)
    if rolloff > ratio:
        raise ValueError(f"rolloff is {rolloff:g}: it must be at most ratio ({ratio})")
    given = {k: v for k, v in {"h_rms": h_rms, "m2": m2, "c0": c0}.items() if v is not None}
    if len(given) != 1:
        raise ValueError(
            f"give exactly one of h_rms, m2 and c0; given: {', '.join(given) or 'none'}"
        )
    (norm, value), *_ = given.items()
    target = real(norm, value, NORMALISATIONS[norm])
    choice("amplitudes", amplitudes, get_args(Amplitudes))
    top = n0 * ratio
    if top > MOST_WAVES:
        raise ValueError(f"n0 · ratio is {top}: it must be at most {MOST_WAVES}")
    phase_stream, size_stream = np.random.SeedSequence(seed).spawn(2)
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
    """Interpolate equally spaced heights of one period by a band-limited profile of zero mean.

    Parameters
    ----------
    heights : array, shape (n,), n ≥ 3
        Heights in m at x_j = j λ/n.
    period : float
        λ in m.

    Notes
    -----
    For even n the component at the Nyquist wave number has no phase; it is split evenly between
    both signs, so that the profile passes through all heights.

    Raises
    ------
    ValueError
        If the heights are not one row of at least 3 finite numbers, one of them is masked, all are
        equal, or a numeric index (of pandas, xarray) leaves some out.
    TypeError
        If they are not real numbers (booleans are not).

    References
    ----------
    docs/theory.md, "2. Profiles"

    Examples
    --------
    >>> import numpy as np
    >>> from adhesis import profile_from_heights
    >>> profile = profile_from_heights(1e-6 * np.array([2, 3, -1, 0]), period=1e-3)
    >>> (1e6 * profile.heights(8)[::2]).round(9)  # the same but for their mean
    array([ 1.,  2., -2., -1.])
    """
    check_index("heights", heights)
    h = finite_row("heights", heights, entry="height")
    if h.size < 3:
        raise ValueError(f"heights hold {h.size} value(s): at least 3 are needed for one period")
    real("largest height", float(np.abs(h).max()), _HEIGHT_OR_NONE)
    a = np.fft.rfft(h - h.mean()) / h.size
    # Rounding noise is set to 0, so that a flat or band-limited input remains so.
    a[np.abs(a) < 1e-15 * np.abs(h).max()] = 0
    a[0] = 0
    if h.size % 2 == 0:
        a[-1] = a[-1].real / 2
    return Profile(period, a)


def single_wave(amplitude: float, period: float) -> Profile:
    """Return h = A cos(q0 x): the profile of the exact references.

    Parameters
    ----------
    amplitude : float
        A in m, not 0.
    period : float
        λ in m.

    Raises
    ------
    ValueError, TypeError
        As :class:`Profile`.

    References
    ----------
    docs/theory.md, "2. Profiles"

    Examples
    --------
    >>> from adhesis import single_wave
    >>> wave = single_wave(amplitude=1e-6, period=1e-3)
    >>> round(wave.h_max / wave.h_rms, 9)  # that of a sine is the root of 2
    1.414213562
    """
    amplitude = real("amplitude", amplitude, FINITE)
    return Profile(period, np.array([0.0, amplitude / 2], dtype=np.complex128))
