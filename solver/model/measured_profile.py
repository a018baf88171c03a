"""Convert a measured trace to one period of a profile: form, continuation, band, spectrum.

A trace is a row of equally spaced heights, not periodic. Each step of the conversion is one
function, in SI units. Reading the file and choosing the steps is left to the caller.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.polynomial import legendre

from adhesis.solver.checks import choice
from adhesis.solver.model.profile import Array, Profile, profile_from_heights
from adhesis.solver.values import ByValue

Continuation = Literal["taper", "blend"]
CONTINUATIONS: tuple[Continuation, ...] = get_args(Continuation)

# Bands of the averaged spectrum per factor of two in wavelength.
_BANDS_PER_OCTAVE = 4

_HIGHEST_FORM = 12  # degree up to which a form stands out from roughness

# Least ratio of the mean power in the last quarter of the band to the quarter before that counts as
# white noise (ratio 1). The power of roughness falls at least as 1/q (ratio at most 0.7).
_FLAT = 0.8


def polynomial_form(heights: Array, degree: int) -> Array:
    """Fit the least-squares polynomial of the given degree to the heights, shape (n,), in m.

    It is the form, not the roughness: degree 0 is the mean, 1 the tilt, 2 a bow.

    Raises
    ------
    ValueError
        If the degree is negative, or too high for the number of heights.
    """
    if degree < 0 or degree + 2 > heights.size:
        raise ValueError(f"degree is {degree}: it must lie between 0 and {heights.size - 2}")
    x = np.linspace(-1.0, 1.0, heights.size)
    series = legendre.legfit(x, heights, degree)
    return np.asarray(legendre.legval(x, series))


def form_shares(heights: Array) -> Array:
    """Compute the mean square height in m² of each Legendre polynomial of degree 0 … 12.

    The coefficients are those of one least-squares fit; a form (tilt, bow) stands out at its
    degree, roughness is spread over the high degrees.
    """
    degree = min(_HIGHEST_FORM, heights.size - 2)
    series = legendre.legfit(np.linspace(-1.0, 1.0, heights.size), heights, degree)
    return np.asarray(series**2 / (2 * np.arange(degree + 1) + 1))


def one_period(
    heights: Array, step: float, continuation: Continuation, part: float = 0.05
) -> tuple[Array, float]:
    """Make one period of heights from a level trace; returns it and its length in m.

    Parameters
    ----------
    heights : array, shape (n,)
        Level heights in m.
    step : float
        In m.
    continuation : {"taper", "blend"}
        ``taper``: both ends fade to the mean over ``part`` of the length (Tukey's window), period
        n steps. ``blend``: the last ``part`` of the trace is cross-faded with the first one, with
        weights whose squares add up to one, which preserves the mean square height; period
        (1 - part) n steps.
    part : float
        Changed share of the length, 0 < part < 0.5.

    Raises
    ------
    ValueError
        For an unknown continuation or a part outside its range.
    """
    n = heights.size
    choice("continuation", continuation, CONTINUATIONS)
    if not 0 < part < 0.5:
        raise ValueError(f"part is {part!r}: it must lie between 0 and 0.5, both excluded")
    ends = max(2, round(part * n))
    rise = 0.5 * (1 - np.cos(np.pi * (np.arange(ends) + 0.5) / ends))
    if continuation == "taper":
        window = np.ones(n)
        window[:ends], window[-ends:] = rise, rise[::-1]
        return (heights - heights.mean()) * window, n * step
    angle = 0.5 * np.pi * rise
    period = heights[: n - ends].copy()
    period[:ends] = np.sin(angle) * period[:ends] + np.cos(angle) * heights[n - ends :]
    return period, (n - ends) * step


def band_limited(heights: Array, period: float, shortest: float) -> Profile:
    """Make the profile with the waves of one period of heights not shorter than ``shortest`` (m).

    Raises
    ------
    ValueError
        If the heights are too few for the shortest wave, or the period is shorter than it.
    """
    highest = int(period / shortest * (1 + 1e-9))
    if highest < 1:
        raise ValueError(f"no wave of {shortest:g} m or more fits into a period of {period:g} m")
    if 2 * highest >= heights.size:
        raise ValueError(
            f"{heights.size} heights over {period:g} m do not hold waves down to {shortest:g} m"
        )
    waves = np.fft.rfft(heights)[: highest + 1] / heights.size
    nodes = 2 * highest + 1
    return profile_from_heights(np.asarray(np.fft.irfft(waves, nodes) * nodes), period)


# ---------------------------------------------------------------------- spectrum


@dataclass(frozen=True, eq=False, repr=False)
class TraceSpectrum(ByValue):
    """Power spectrum of a level trace, averaged over bands of wave numbers.

    Attributes
    ----------
    wave_number : array, shape (k,)
        q in rad/m, geometric middle of each band, ascending.
    power : array, shape (k,)
        C(q) in m³, both signs of q: (1/2π) ∫ C dq over all q is the mean square height.
    floor : float
        C of white noise in m³; 0 if the spectrum still falls at its end.
    noise : float
        Root mean square of that noise in m, up to the Nyquist wave number.
    """

    wave_number: Array
    power: Array
    floor: float
    noise: float

    def curvature(self, shortest: Array) -> Array:
        """Compute the rms curvature (1/m) of the waves not shorter than each wavelength (m)."""
        q = self.wave_number
        power = np.maximum(self.power - self.floor, 0.0) * q**4
        within = np.concatenate([[0.0], np.cumsum(np.diff(q) * (power[1:] + power[:-1]) / 2)])
        return np.asarray(np.sqrt(np.interp(2 * np.pi / np.asarray(shortest), q, within) / np.pi))


def trace_spectrum(heights: Array, step: float) -> TraceSpectrum:
    """Compute the spectrum of a level trace with Hann's window; heights and step in m."""
    n = heights.size
    window = np.hanning(n + 2)[1:-1]
    window /= np.sqrt(np.mean(window**2))
    power = np.abs(np.fft.rfft((heights - heights.mean()) * window)) ** 2 * step / n
    q = 2 * np.pi * np.fft.rfftfreq(n, step)
    floor = _white_floor(power)
    number = np.arange(1, q.size)
    # One band per wave at long wavelengths, where there are few; then bands of equal ratio.
    band = np.where(
        number < 2 * _BANDS_PER_OCTAVE, number, np.floor(_BANDS_PER_OCTAVE * np.log2(number)) + 1e6
    )
    _, first, count = np.unique(band, return_index=True, return_counts=True)
    middle = np.sqrt(q[1:][first] * q[1:][first + count - 1])
    mean = np.add.reduceat(power[1:], first) / count
    return TraceSpectrum(middle, mean, floor, float(np.sqrt(floor / step)))


def _white_floor(power: Array) -> float:
    """Compute the power at which the last half of the band levels off; 0 if it does not."""
    half, last = power.size // 2, 3 * power.size // 4
    if power.size < 32:
        return 0.0
    before, after = float(power[half:last].mean()), float(power[last:-1].mean())
    # Statistical scatter of the ratio. Roughness mistaken for noise has no consequence: the step
    # cuts it off at the same wavelength.
    scatter = 2 * np.sqrt(2 / (power.size - last))
    return min(before, after) if after > (_FLAT - scatter) * before else 0.0


def trusted_wavelength(spectrum: TraceSpectrum, step: float, tip_radius: float) -> dict[str, float]:
    """Compute the shortest reliable wavelength of a trace in m, for each limiting effect.

    ``step``: five heights per wave. ``noise``: the end of the last band whose power exceeds four
    times that of the white noise. ``tip``: the wavelength at which the rms curvature of the kept
    waves reaches 1/(2R), as a tip of radius R (m; 0 for none) does not follow sharper ones (Sanner
    et al., Appl. Surf. Sci. Adv. 7, 100190, 2022). A limit that does not apply is 0.
    """
    limits = {"step": 5 * step, "noise": 0.0, "tip": 0.0}
    q = spectrum.wave_number
    if spectrum.floor > 0:
        above = np.flatnonzero(spectrum.power > 4 * spectrum.floor)
        last = int(above[-1]) if above.size else 0
        if last + 1 < q.size:
            limits["noise"] = float(2 * np.pi / np.sqrt(q[last] * q[last + 1]))
    if tip_radius > 0:
        lengths = 2 * np.pi / q
        sharp = np.flatnonzero(spectrum.curvature(lengths) > 0.5 / tip_radius)
        if sharp.size:
            limits["tip"] = float(lengths[sharp[0]])
    return limits
