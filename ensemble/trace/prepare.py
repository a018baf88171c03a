"""Prepare a trace: level heights and a cut-off, with a record of each step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from adhesis.ensemble.errors import InputError, parameter, refused_as_input
from adhesis.ensemble.quantities import length_text, percent
from adhesis.ensemble.trace.reading.measured_trace import MIN_POINTS, Trace
from adhesis.ensemble.trace.single_features import Feature, excluding, single_features
from adhesis.solver.checks import LENGTH, Bounds, counted, flag, instance, number_of, real, whole
from adhesis.solver.model.measured_profile import (
    Continuation,
    TraceSpectrum,
    band_limited,
    form_shares,
    one_period,
    polynomial_form,
    trace_spectrum,
    trusted_wavelength,
)
from adhesis.solver.model.profile import Array, Profile
from adhesis.solver.values import ByValue

Mask = NDArray[np.bool_]

MAX_DEGREE = 6
_DEGREE = Bounds(0, MAX_DEGREE, whole=True)
_LENGTH_OR_NONE = Bounds(0.0, LENGTH.high, unit="m")

# A spike exceeds the medians of the four heights on either side by so many robust standard
# deviations. More than this share of the heights are no spikes.
_SIDE, _SPIKE = 4, 10.0
_MAX_SPIKES = 0.01
# Equal heights were not measured, but held or cut off by an instrument, in rows that hold so many
# beyond pairs, as of crests, and of which the longest has so many times the equal neighbours of all
# other rows but this share. Of 6000 self-affine traces, in few digits or many, none has such rows.
_HELD, _LONGER, _FEW_ROWS = 3, 8, 0.01
# Gaps are interpolated up to this length: number of steps, or share of the trace if that is more.
_GAP_STEPS, _GAP_SHARE = 5, 0.01
# Share of heights that may be missing in all.
_MAX_MISSING = 0.10
# A degree is a form if its mean square height exceeds each of the six degrees above by this factor,
# and surely one at the second factor; looked for up to the last number.
_FORM, _SURE_FORM, _FORM_TO = 8.0, 30.0, 4
# Rounding of lengths that messages show with six digits.
_SHOWN = 5e-6
# A trace is refused as noise if its rms height is below this multiple of the noise.
_MIN_TO_NOISE = 1.1
# Warn above this share of the two longest waves in the mean square height.
_LONG_WAVES = 0.5


@dataclass(frozen=True)
class Step:
    """One step of the preparation, described in words and in numbers (SI)."""

    name: str
    description: str
    numbers: dict[str, float] = field(default_factory=dict)


@dataclass
class _Work:
    """A preparation under way: its trace, the steps that were taken, and what is doubtful."""

    trace: Trace
    steps: list[Step] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def note(self, name: str, description: str, **numbers: float) -> None:
        """Take note of a step."""
        self.steps.append(Step(name, description, numbers))


@dataclass(frozen=True, eq=False, repr=False)
class Prepared(ByValue):
    """Trace that is ready for the loop, with all decisions of its preparation.

    Attributes
    ----------
    trace : Trace
    filled, gaps : array, shape (n,)
        Heights in m without outliers and gaps, not yet level; whether each of them was filled in.
    start : float
        Position of the first of them in the trace, in m: 0 unless heights are missing there.
    excluded : tuple
        Begin and end of the ranges that were excluded, in m from the first point of the trace.
    features : tuple of Feature
        Single crests and troughs that stand far out of all others.
    degree : int
        Degree of the polynomial that is subtracted.
    form_is_sure : bool
        Whether a form of that degree stands out so far that a lower one is no alternative.
    cut_off : float
        Shortest wavelength kept, in m.
    limits : dict
        Shortest reliable wavelength in m, by what limits it.
    spectrum : TraceSpectrum
        Spectrum of the level heights.
    steps : tuple of Step
    warnings : tuple of str
    """

    trace: Trace
    filled: Array
    gaps: Array
    start: float
    excluded: tuple[tuple[float, float], ...]
    features: tuple[Feature, ...]
    degree: int
    form_is_sure: bool
    cut_off: float
    limits: dict[str, float]
    spectrum: TraceSpectrum
    steps: tuple[Step, ...]
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        """Return one line: the file, its number of points, and the decisions."""
        return (
            f"Prepared({self.trace.source!r}, {self.filled.size} points, degree={self.degree}, "
            f"cut_off={length_text(self.cut_off)}, {counted(len(self.warnings), 'warning')})"
        )

    @property
    def step(self) -> float:
        """Distance of two heights, in m."""
        return self.trace.step

    def level(self, degree: int | None = None, *, without_features: bool = False) -> Array:
        """Subtract the form, also one of another degree; return heights in m."""
        heights = self.filled
        if without_features:  # straight lines in place of the single crests and troughs
            index = np.arange(heights.size)
            kept = np.ones(index.size, dtype=bool)
            for feature in self.features:
                kept &= ~_within(feature.begin, feature.end, self.start, self.step, index.size)
            heights = np.interp(index, index[kept], heights[kept])
        return heights - polynomial_form(heights, self.degree if degree is None else degree)

    def profile(
        self,
        *,
        degree: int | None = None,
        continuation: Continuation = "blend",
        part: float = 0.05,
        cut_off: float | None = None,
        noise_seed: int | None = None,
        without_features: bool = False,
    ) -> Profile:
        """Make one period of a profile of the trace; arguments replace single decisions.

        ``noise_seed`` adds white noise of the size that the instrument is estimated to add,
        ``without_features`` bridges the single crests and troughs.
        """
        heights = self.level(degree, without_features=without_features)
        if noise_seed is not None:
            noise = np.random.default_rng(noise_seed).standard_normal(heights.size)
            heights = heights + self.spectrum.noise * noise
        period, length = one_period(heights, self.step, continuation, part)
        return band_limited(period, length, self.cut_off if cut_off is None else cut_off)


def prepare_trace(
    trace: Trace,
    *,
    degree: int | None = None,
    cut_off: float | None = None,
    tip_radius: float | None = None,
    longest_gap: float | None = None,
    keep_outliers: bool = False,
    invert: bool = False,
    exclude: Sequence[tuple[float, float]] = (),
) -> Prepared:
    """Remove outliers and form, fill gaps, and choose the shortest wave to keep.

    Parameters
    ----------
    trace : Trace
    degree : int, optional
        Degree of the polynomial that is subtracted, 0 … 6; without it 1 (tilt), or more if a form
        stands out.
    cut_off : float, optional
        Shortest wavelength kept, in m; without it the longest of the limits that step, noise and
        tip set (:func:`adhesis.solver.model.measured_profile.trusted_wavelength`).
    tip_radius : float, optional
        In m; without it that of the file, if there is one.
    longest_gap : float, optional
        Drop-outs up to this length (m) are interpolated, longer ones refused.
    keep_outliers : bool
        Keep spikes.
    invert : bool
        Change the sign of the heights, for an instrument whose z points into the sample.
    exclude : sequence of pairs, shape (k, 2)
        Ranges that are treated as drop-outs of any length: begin and end in m, from the first
        point of the trace, as in ``[(1.2e-3, 1.3e-3)]``.

    Raises
    ------
    InputError
        If a gap is too long, too many heights are missing, or a value breaks its rule.
    TypeError
        If the trace is no Trace, or a value has the wrong type.

    References
    ----------
    docs/measured-profile.md, "Preparation"

    Examples
    --------
    >>> from adhesis import Trace, prepare_trace
    >>> round(1e6 * prepare_trace(Trace([0, 1e-6, 3e-6, 1e-6] * 50, 5e-6)).cut_off)  # 5 steps
    25
    """
    instance("trace", trace, Trace, "read_trace(source)")
    flag(parameter("keep_outliers"), keep_outliers)
    flag(parameter("invert"), invert)
    with refused_as_input():
        if degree is not None:
            degree = whole(parameter("degree"), degree, _DEGREE)
        cut_off = _length("cut_off", cut_off, LENGTH)
        tip_radius = _length("tip_radius", tip_radius, _LENGTH_OR_NONE)
        longest_gap = _length("longest_gap", longest_gap, _LENGTH_OR_NONE)
    ranges = _ranges(exclude)
    work = _Work(trace)
    heights = -trace.heights if invert else trace.heights.copy()
    if invert:
        work.note("turned over", "heights turned over: z pointed into the sample")
    excluded = _excluded(work, heights, ranges)
    heights[excluded] = np.nan
    heights, first = _without_ends(work, heights)
    excluded, start = excluded[first : first + heights.size], first * trace.step
    _warn_of_held(work, heights, start)
    if not keep_outliers:
        heights = _without_outliers(work, heights)
    filled, gaps = _filled(work, heights, excluded, start, longest_gap)
    chosen = _degree(work, filled, degree)
    level = filled - polynomial_form(filled, chosen)
    rms = float(np.sqrt(np.mean(level**2)))
    work.steps[-1].numbers["rms_level"] = rms
    if rms <= 1e-12 * float(np.ptp(filled)):
        raise InputError(f"{trace.source} is flat when level: nothing is left but rounding")
    spectrum = trace_spectrum(level, trace.step)
    radius = (trace.tip_radius if tip_radius is None else tip_radius) or 0.0
    limits = trusted_wavelength(spectrum, trace.step, radius)
    shortest = _cut_off(work, filled.size * trace.step, rms, cut_off, limits, radius, spectrum)
    _long_waves(work, spectrum, rms)
    features = single_features(level, trace.step, start)
    return Prepared(
        trace=trace,
        filled=filled,
        gaps=gaps,
        start=start,
        excluded=ranges,
        features=features,
        degree=chosen,
        form_is_sure=_prominence(form_shares(filled), chosen) > _SURE_FORM,
        cut_off=shortest,
        limits=limits,
        spectrum=spectrum,
        steps=tuple(work.steps),
        warnings=(
            *trace.warnings,
            *(feature.warning for feature in features),
            *work.warnings,
        ),
    )


def _length(name: str, value: float | None, bounds: Bounds) -> float | None:
    return None if value is None else real(parameter(name), value, bounds)


# ---------------------------------------------------------------------- gaps and outliers


def _ranges(exclude: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    """Return the excluded ranges as pairs of floats, in order (TypeError, InputError)."""
    name = parameter("exclude")
    rule = "pairs of positions in m, as in [(1.2e-3, 1.3e-3)]"
    if isinstance(exclude, str | bytes) or not hasattr(exclude, "__iter__"):
        raise TypeError(f"{name} is {exclude!r}: it must hold {rule}")
    pairs = []
    for pair in exclude:
        numbers = [number_of(value) for value in pair] if hasattr(pair, "__iter__") else []
        if len(numbers) != 2 or None in numbers:
            raise TypeError(f"{name} holds {pair!r}: it must hold {rule}")
        begin, end = (float(value) for value in pair)
        if not 0 <= begin < end < np.inf:
            raise InputError(
                f"{name} holds the range from {length_text(begin, 6)} to {length_text(end, 6)}: a "
                "range must begin at 0 or later, and end beyond its beginning"
            )
        pairs.append((begin, end))
    return tuple(sorted(pairs))


def _within(begin: float, end: float, start: float, step: float, size: int) -> Mask:
    """Return which heights lie in a range, its ends included."""
    position = start + step * np.arange(size)
    rounding = 1e-6 * step
    return np.asarray((position >= begin - rounding) & (position <= end + rounding))


def _excluded(work: _Work, heights: Array, ranges: Sequence[tuple[float, float]]) -> Mask:
    trace = work.trace
    excluded = np.zeros(heights.size, dtype=bool)
    for begin, end in ranges:
        inside = _within(begin, end, 0.0, trace.step, heights.size)
        words = f"{length_text(begin, 6)} to {length_text(end, 6)}"
        if not inside.any():
            raise InputError(
                f"{parameter('exclude')} holds the range from {words}, in which there is no "
                f"height: {trace.source} reaches from 0 to {length_text(trace.length, 6)} in steps "
                f"of {length_text(trace.step)}"
            )
        count = int(inside.sum())
        work.note(
            "excluded",
            f"{words}, as given: {counted(count, 'height')} treated as "
            f"{'a drop-out' if count == 1 else 'drop-outs'}",
            **{"begin": begin, "end": end, "points": count},
        )
        excluded |= inside
    left = int(np.isfinite(heights[~excluded]).sum())
    if ranges and left < MIN_POINTS:
        raise InputError(
            f"{parameter('exclude')} leaves {counted(left, 'height')} of {trace.source}: at least "
            f"{MIN_POINTS} must be left"
        )
    return excluded


def _without_ends(work: _Work, heights: Array) -> tuple[Array, int]:
    """Cut missing heights off both ends, where interpolation is impossible.

    Returns the others, and the index of the first of them.
    """
    good = np.flatnonzero(np.isfinite(heights))
    first, last = int(good[0]), int(good[-1]) + 1
    lost = heights.size - (last - first)
    if lost:
        described = f"cut off where heights are missing: {lost}"
        work.note("ends", described, points=lost, length=lost * work.trace.step)
    return heights[first:last], first


def _warn_of_held(work: _Work, heights: Array, start: float) -> None:
    """Warn of rows of one height, or of the lowest and the highest, far longer than the others."""
    begins = np.flatnonzero(np.append(True, np.diff(heights) != 0))
    counts = np.diff(np.append(begins, heights.size))
    levels, k = heights[begins], int(np.argmax(counts))
    ends = np.isin(levels, (np.nanmin(heights), np.nanmax(heights)))
    held = ends if ends[k] else levels == levels[k]
    others = np.quantile(np.append(counts[~held], 1), 1 - _FEW_ROWS) - 1
    if (counts[held] - 2).clip(0).sum() < _HELD or counts[k] - 1 < _LONGER * others:
        return
    begin = start + float(begins[k]) * work.trace.step
    end = begin + float(counts[k] - 1) * work.trace.step
    work.warnings.append(
        f"{counts[k]} heights in a row from {length_text(begin)} on are equal "
        f"({counts[held].sum()} in all), as hardly two elsewhere: if they are cut off at the range "
        "of the instrument, measure with a larger one; if they stand for missing ones, or were "
        f"held where nothing was measured, leave them out, with NaN or by {excluding(begin, end)}"
    )


def _without_outliers(work: _Work, heights: Array) -> Array:
    known = np.isfinite(heights)
    row = heights[known]
    around = sliding_window_view(np.pad(row, _SIDE, mode="edge"), 2 * _SIDE + 1)
    left = np.median(around[:, :_SIDE], axis=1)
    right = np.median(around[:, _SIDE + 1 :], axis=1)
    # A spike exceeds both sides, the edge of a step only one.
    rest = np.maximum(row - np.maximum(left, right), np.minimum(left, right) - row)
    spread = 1.4826 * float(np.median(np.abs(row - (left + right) / 2)))
    # Crests of a smooth or saw-like trace exceed their sides by no more than these rise.
    spread = max(spread, 0.15 * float(np.median(np.abs(right - left))), 1e-6 * float(np.std(row)))
    spikes = rest > _SPIKE * spread
    count = int(spikes.sum())
    if not count:
        return heights
    if count > max(3, _MAX_SPIKES * row.size):
        work.warnings.append(
            f"{count} heights stand {_SPIKE:g} standard deviations out of their surroundings: too "
            "many for outliers, so they stay; is the surface made of steps, or the trace faulty?"
        )
        return heights
    found = heights.copy()
    found[np.flatnonzero(known)[spikes]] = np.nan
    highest = float(rest[spikes].max())
    work.note(
        "outliers",
        f"{counted(count, 'outlier')} ({'' if count == 1 else 'up to '}{length_text(highest)}) "
        f"removed and treated as {'a drop-out' if count == 1 else 'drop-outs'}",
        points=count,
        highest=highest,
    )
    return found


def _filled(
    work: _Work, heights: Array, excluded: Mask, start: float, longest: float | None
) -> tuple[Array, Array]:
    """Fill gaps by straight lines; return heights, and which of them were filled.

    What was excluded does not count in the length of a gap.
    """
    trace, gaps = work.trace, ~np.isfinite(heights)
    if not gaps.any():
        return heights, gaps
    share = float(gaps.mean())
    if share > _MAX_MISSING:
        with_these = f", with what {parameter('exclude')} removes" if excluded.any() else ""
        raise InputError(
            f"{trace.source} lacks {100 * share:.1f} % of its heights{with_these}: up to "
            f"{100 * _MAX_MISSING:.0f} % may lack{_why_missing(trace)}"
        )
    edges = np.flatnonzero(np.diff(np.concatenate([[False], gaps, [False]]).astype(int)))
    starts, ends = edges[::2], edges[1::2]
    missing = np.add.reduceat((gaps & ~excluded).astype(int), starts)
    worst = int(np.argmax(missing))
    longest_here = float(missing[worst] + 1) * trace.step
    allowed = max(_GAP_STEPS, _GAP_SHARE * heights.size) * trace.step
    allowed = allowed if longest is None else longest
    if missing[worst] and longest_here > allowed * (1 + _SHOWN):
        at = start + int(starts[worst]) * trace.step
        raise InputError(
            f"{trace.source} has a gap of {length_text(longest_here, 6)} at {length_text(at)}: "
            f"up to {length_text(allowed, 6)} "
            f"is interpolated ({parameter('longest_gap')} allows more){_why_missing(trace)}"
        )
    index = np.arange(heights.size)
    filled = heights.copy()
    filled[gaps] = np.interp(index[gaps], index[~gaps], heights[~gaps])
    longest_filled = float((ends - starts).max() + 1) * trace.step
    count = int(gaps.sum())
    work.note(
        "drop-outs",
        f"{counted(count, 'height')} ({percent(share)}) in {counted(starts.size, 'gap')} "
        f"interpolated by straight lines, the longest over {length_text(longest_filled)}",
        **{"points": count, "gaps": starts.size, "longest": longest_filled},
    )
    return filled, gaps


def _why_missing(trace: Trace) -> str:
    """Return how heights became drop-outs when they were read, to follow a message."""
    notes = [note for note in trace.notes if "drop-outs" in note]
    return f"; {'; '.join(notes)}" if notes else ""


# ---------------------------------------------------------------------- form


def _degree(work: _Work, filled: Array, wanted: int | None) -> int:
    """Choose the degree of the form, unless given; warn of a form that is not subtracted."""
    shares = form_shares(filled)
    stands_out = [d for d in range(2, _FORM_TO + 1) if _prominence(shares, d) > _FORM]
    found = max(stands_out, default=1)
    degree = found if wanted is None else wanted
    line = filled[-1] - filled[0] if degree else 0.0
    fit = polynomial_form(filled, degree)
    names = {0: "mean", 1: "tilt", 2: "tilt and bow"}
    name = names.get(degree, f"form of degree {degree}")
    bow = float(np.ptp(fit - polynomial_form(filled, min(1, degree))))
    why = "a form stands out of the roughness" if found > 1 else "no form beyond a tilt stands out"
    said = f"{name} subtracted ({why if wanted is None else 'as given'})"
    numbers = {"degree": degree, "rise": float(line)}
    if bow > 0:
        said += f": {length_text(bow)} from lowest to highest beside the tilt"
        numbers["form_height"] = bow
    work.note("form", said, **numbers)
    if wanted is not None and found > wanted:
        left = float(np.sqrt(shares[wanted + 1 : found + 1].sum()))
        work.warnings.append(
            f"a form of degree {found} remains ({length_text(left)} rms, as of a curved sample "
            f"or guide): it counts as roughness with {parameter('degree')} {wanted}"
        )
    return degree


def _prominence(shares: Array, degree: int) -> float:
    """Return the mean square height of a degree over the largest of the six degrees above."""
    above = shares[degree + 1 : degree + 7]
    return float(shares[degree] / above.max()) if above.size and above.max() > 0 else 0.0


def _long_waves(work: _Work, spectrum: TraceSpectrum, rms: float) -> None:
    q, power = spectrum.wave_number, spectrum.power
    # The first bands hold one wave each, q0 apart: the mean square of a wave is 2 C q0/2π.
    share = float(2 * power[:2].sum() * q[0] / (2 * np.pi) / rms**2)
    if share > _LONG_WAVES:
        work.warnings.append(
            f"waves longer than a third of the trace hold {100 * min(share, 1.0):.0f} % of the "
            "mean square height: they decide the loss, and one trace has only one or two of them; "
            f"measure a longer one, or several, or take the form off ({parameter('degree')})"
        )


# ---------------------------------------------------------------------- cut-off


def _cut_off(
    work: _Work,
    length: float,
    rms: float,
    wanted: float | None,
    limits: dict[str, float],
    radius: float,
    spectrum: TraceSpectrum,
) -> float:
    trace = work.trace
    by = max(limits, key=lambda name: limits[name])
    shortest = limits[by]
    reasons = {
        "step": "five steps",
        "noise": "below it the noise of the instrument",
        "tip": f"what a tip of radius {length_text(radius)} follows",
    }
    if wanted is not None:
        low, high = 2.2 * trace.step, length / 2
        if not low * (1 - _SHOWN) <= wanted <= high * (1 + _SHOWN):
            raise InputError(
                f"{parameter('cut_off')} is {length_text(wanted, 6)}: it must lie between 2.2 "
                f"steps ({length_text(low, 6)}) and half the length ({length_text(high, 6)})"
            )
        wanted = min(max(wanted, low), high)
        if wanted < shortest * (1 - 1e-9):
            work.warnings.append(
                f"the cut-off {length_text(wanted)} is shorter than what the trace can be trusted "
                f"with, {length_text(shortest)} ({reasons[by]})"
            )
        shortest, why = wanted, "as given"
    else:
        why = reasons[by]
        if shortest > length / 4 and by != "noise":
            raise InputError(
                f"{trace.source} is {length_text(length)} long, and waves can be trusted from "
                f"{length_text(shortest)} on ({why}): give {parameter('cut_off')} to go on all the "
                "same"
            )
        if shortest > length / 4 or rms < _MIN_TO_NOISE * spectrum.noise:
            raise InputError(
                f"{trace.source} holds no roughness above its noise: of {length_text(rms)} rms "
                f"{length_text(spectrum.noise)} are noise, waves can be trusted from "
                f"{length_text(shortest)} on, and it is {length_text(length)} long "
                f"(give {parameter('cut_off')} to go on)"
            )
    noise = f"; white noise of {length_text(spectrum.noise)} rms" if spectrum.floor > 0 else ""
    work.note(
        "cut-off",
        f"waves shorter than {length_text(shortest, 4)} dropped ({why}){noise}",
        cut_off=shortest,
        noise_rms=spectrum.noise,
        **{f"limit_{name}": limit for name, limit in limits.items()},
    )
    return shortest
