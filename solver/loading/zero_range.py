"""Where the zero-range limit ends: the largest tension inside patches, and the ranges it allows.

A zero range of adhesion is an infinite strength: inside a contact nothing opens, whatever the
tension there. An interface of range δ gives way near σ_th = γ/δ. So with σ_in the largest local
maximum of tension inside patches, away from their edges, where tension is singular, the limit holds
for ranges below

    valid_range = γ/σ_in.

At an edge a range δ smears the singularity over a cohesive zone of the length (π/8)(K/σ_th)² =
(π/4) E* δ²/γ (Dugdale, with K² = 2E*γ). It has to be short beside the narrowest length l that
decides where edges stand, which holds for ranges well below

    edge_range = sqrt(4 γ l/(π E*)).

l is the least of λ_min and of the patches and gaps beside the edges that move in the jumps which
make up nine tenths of all drops, as long as these are before the jump.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.checks import counted
from adhesis.solver.loading.path_record import Record
from adhesis.solver.method import ContactState, Method
from adhesis.solver.model.jump import Branch, Jump
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array

DOUBTFUL_RANGE = 1e-9
"""``valid_range`` below which a loss is doubtful, in m: real adhesion has 0.2 to 10 nm."""

DOUBTFUL_LOSS = 20.0
"""Loss over γ A_max/A0 above which a loss is doubtful (docs/zero-range.md)."""

DOUBTFUL_EXCESS = 1.01
"""Tension inside patches over a finite strength above which a loss is doubtful: a hundredth is
what a crack that closed again waits for (``solver.crack.HEALED_TENSION``)."""

DOUBTFUL_BARRIER = 0.1
"""Barriers of all openings over the loss above which a loss is doubtful (docs/zero-range.md)."""

# Tension is looked at before so many jumps of unloading, those with the largest drops: what carries
# the largest tension is what gives way with a large drop. And at so many states of the whole path.
_JUMPS, _SAMPLES = 16, 6
_MOST_OF_LOSS = 0.9
_SAME = 1e-9  # of the period: edges that differ by less have not moved
_ROUNDED = 1e-12  # prescribed values that differ by less, of themselves, are equal


@dataclass(frozen=True)
class InteriorTension:
    """Largest local maximum of tension inside patches, away from their edges, on a path.

    Attributes
    ----------
    tension : float
        σ_in in Pa, positive.
    position : float
        x in m.
    branch : {"loading", "unloading"}
    penetration : float
        Δ/h_max of the state.

    References
    ----------
    docs/zero-range.md
    """

    tension: float
    position: float
    branch: Branch
    penetration: float


def interior_tension(method: Method, record: Record) -> InteriorTension | None:
    """Find the largest tension inside patches on a path; None if there is none.

    With zero range the states before the sixteen jumps of unloading with the largest drops are
    looked at, and six states evenly spaced on the path. At a finite strength it is all states but
    those that a jump led to and from which patches open at once. Without adhesion nothing is in
    tension.
    """
    if method.problem.work_of_adhesion == 0:
        return None
    opens = math.isfinite(method.problem.strength)
    places = _without_passed(method.problem, record) if opens else _sampled(record)
    places = [place for place in places if record.states[place].patches]
    found = method.largest_tension([record.states[place] for place in places])
    if found is None:
        return None
    place = places[found.state]
    separation = record.states[place].separation
    return InteriorTension(
        tension=found.tension,
        position=found.position,
        branch=record.branches[place],
        penetration=float(method.problem.penetration(separation)),
    )


def _sampled(record: Record) -> list[int]:
    """Return the places of the states that are looked at where nothing opens."""
    starts = [
        (jump.energy_drop, place)
        for jump, place in zip(record.jumps, jump_places(record), strict=True)
        if jump.branch == "unloading"
    ]
    starts.sort(key=lambda entry: -entry[0])
    spaced = np.linspace(0, len(record.states) - 1, _SAMPLES + 2)[1:-1].astype(int)
    return sorted({*(place for _, place in starts[:_JUMPS]), *spaced.tolist()})


def _without_passed(problem: Problem, record: Record) -> list[int]:
    """Return the places of all states but those at which a path does not stay.

    A jump led to them, and an opening starts from them at the same prescribed value.
    """
    opened = {(j.separation, j.contact_before) for j in record.jumps if j.kind == "opening"}
    out = []
    before = math.nan
    for place, state in enumerate(record.states):
        prescribed = problem.prescribed_in(state)
        stays = (state.separation, state.contact_fraction) not in opened
        if stays or not math.isclose(before, prescribed, rel_tol=_ROUNDED):
            out.append(place)
        before = prescribed
    return out


def jump_places(record: Record) -> list[int]:
    """Return the place among the states of the one from which each jump starts."""
    out = []
    place = 0
    states = record.states
    for jump in record.jumps:
        while place < len(states) - 2 and not _joins(jump, states[place], states[place + 1]):
            place += 1
        out.append(place)
    return out


def _joins(jump: Jump, before: ContactState, after: ContactState) -> bool:
    return (
        before.contact_fraction == jump.contact_before
        and after.contact_fraction == jump.contact_after
        and before.separation == jump.separation
    )


def narrowest_length(problem: Problem, record: Record) -> float:
    """Return the shortest length in m that decides where edges stand; see the module."""
    shortest = problem.profile.shortest_wavelength
    order = sorted(
        zip(record.jumps, jump_places(record), strict=True), key=lambda one: -one[0].energy_drop
    )
    rest = _MOST_OF_LOSS * sum(jump.energy_drop for jump, _ in order)
    for jump, place in order:
        if rest <= 0:
            break
        rest -= jump.energy_drop
        before, after = record.states[place].edges, record.states[place + 1].edges
        shortest = min(shortest, _narrowest_moved(before, after, problem.profile.period))
    return shortest


def _narrowest_moved(before: Array, after: Array, period: float) -> float:
    """Return the least length of the patches and gaps of ``before`` beside edges that move."""
    if not len(before):
        return math.inf
    places = np.sort(after.ravel() % period)
    places = np.concatenate([places[-1:] - period, places, places[:1] + period])
    edges = before.ravel() % period
    right = np.searchsorted(places, edges).clip(1, max(len(places) - 1, 1))
    if len(places) < 2:
        moved = np.ones(edges.shape, dtype=bool)
    else:
        nearest = np.minimum(np.abs(edges - places[right - 1]), np.abs(edges - places[right]))
        moved = nearest > _SAME * period
    patch = before[:, 1] - before[:, 0]
    gap = np.append(before[1:, 0], before[0, 0] + period) - before[:, 1]  # right of each patch
    left, right_ = moved.reshape(-1, 2).T
    lengths = (patch[left | right_], gap[right_], np.roll(gap, 1)[left])
    return float(np.concatenate(lengths).min(initial=math.inf))


def valid_range(problem: Problem, interior: InteriorTension | None) -> float:
    """Return γ/σ_in in m; infinite without tension inside patches."""
    return math.inf if interior is None else problem.work_of_adhesion / interior.tension


def edge_range(problem: Problem, narrowest: float) -> float:
    """Return the range in m whose cohesive zone is as long as ``narrowest`` (m)."""
    return math.sqrt(
        4 * problem.work_of_adhesion * narrowest / (math.pi * problem.half_space.modulus)
    )


class HasRanges(Protocol):
    """A loop or a path."""

    @property
    def problem(self) -> Problem:
        """What was solved."""
        ...

    @property
    def openings(self) -> int:
        """Number of openings from inside."""
        ...

    @property
    def barrier(self) -> float:
        """Sum of their barriers, in J/m²."""
        ...

    @property
    def interior(self) -> InteriorTension | None:
        """Largest tension inside patches."""
        ...

    @property
    def valid_range(self) -> float:
        """Range allowed by it, in m."""
        ...

    @property
    def edge_range(self) -> float:
        """Range allowed at edges, in m."""
        ...


def stress_text(pascals: float) -> str:
    """Return a stress in a unit of its size: "100 kPa"."""
    return f"{1e-6 * pascals:.3g} MPa" if pascals >= 1e6 else f"{1e-3 * pascals:.3g} kPa"


def range_summary(result: HasRanges) -> str:
    """Return in a line for a terminal below which ranges of adhesion the zero-range limit holds."""
    interior = result.interior
    strength = result.problem.strength
    if math.isfinite(strength):
        range_ = result.problem.work_of_adhesion / strength
        largest = 0.0 if interior is None else interior.tension
        return (
            f"adhesion of a range of {range_:.3g} m: patches open from inside at {strength:.3g} "
            f"Pa, {counted(result.openings, 'opening')} with barriers of {result.barrier:.2g} "
            f"J/m²; largest tension inside patches {largest:.3g} Pa; at edges "
            f"{result.edge_range:.3g} m"
        )
    if interior is None:
        return "no tension inside patches"
    return (
        "the zero-range model is valid if the real adhesion reaches less than "
        f"{1e9 * result.valid_range:.3g} nm (tension inside patches of "
        f"{stress_text(interior.tension)} on {interior.branch} at Δ/h_max = "
        f"{interior.penetration:.4g}; at edges: {1e9 * result.edge_range:.3g} nm)"
    )


def opening_warnings(jumps: Sequence[Jump], loss: float) -> list[str]:
    """Return the sentence of doubt where barriers of openings are not small beside the loss.

    Parameters
    ----------
    jumps : sequence of Jump
    loss : float
        In J/m².
    """
    barrier = sum(jump.barrier for jump in jumps)
    if barrier <= DOUBTFUL_BARRIER * abs(loss):
        return []
    return [
        f"the barriers of openings add up to {barrier:.2g} J/m², more than {DOUBTFUL_BARRIER:g} "
        f"of the loss ({loss:.3g} J/m²): how patches open, which zero range leaves open, matters "
        "for it (docs/zero-range.md)"
    ]


def beyond_limit(
    valid_range: Any,
    loss: Any,
    work_of_adhesion: Any,
    largest_contact_fraction: Any,
    strength: Any = math.inf,
    barrier: Any = 0.0,
) -> NDArray[np.bool_]:
    """Return which losses zero range alone makes so large; values or arrays of one shape.

    Their valid range is below :data:`DOUBTFUL_RANGE`, or they are more than :data:`DOUBTFUL_LOSS`
    times the work of adhesion of the largest contact. At a finite strength it is those at which
    the tension inside patches exceeds it :data:`DOUBTFUL_EXCESS` times, or whose barriers are more
    than :data:`DOUBTFUL_BARRIER` of them. None is where the strength is unknown (NaN).
    """
    loss, gamma = np.asarray(loss), np.asarray(work_of_adhesion)
    valid_range, strength = np.asarray(valid_range), np.asarray(strength)
    most = DOUBTFUL_LOSS * gamma * np.asarray(largest_contact_fraction)
    closed = (valid_range < DOUBTFUL_RANGE) | ((loss > most) & (gamma > 0))
    exceeded = gamma > DOUBTFUL_EXCESS * strength * valid_range
    opened = exceeded | (np.asarray(barrier) > DOUBTFUL_BARRIER * np.abs(loss))
    return np.asarray(np.where(np.isposinf(strength), closed, np.isfinite(strength) & opened))


def range_warnings(
    problem: Problem, range_: float, loss: float, contact_fraction: Sequence[float] | Array
) -> list[str]:
    """Return the sentences of doubt where a loss is that of the zero-range limit alone.

    At a finite strength patches open from inside; doubtful is then a tension that exceeds it where
    no crack grows.
    """
    out: list[str] = []
    if math.isfinite(problem.strength):
        excess = problem.work_of_adhesion / range_ / problem.strength
        if excess > DOUBTFUL_EXCESS:
            largest_tension = problem.work_of_adhesion / range_
            out.append(
                f"the tension inside patches reaches {largest_tension:.3g} Pa, {excess:.3g} times "
                f"the strength ({problem.strength:.3g} Pa), where no crack that fits grows: how "
                "such places yield, which zero range leaves open, may matter for the loss "
                "(docs/zero-range.md)"
            )
        return out
    if range_ < DOUBTFUL_RANGE:
        out.append(
            f"valid_range is {1e9 * range_:.3g} nm: the zero-range limit holds only for ranges of "
            f"adhesion below it, and below {1e9 * DOUBTFUL_RANGE:g} nm hardly any interface has "
            "one, so patches would open from inside and lose less (docs/zero-range.md)"
        )
    largest = float(np.max(contact_fraction, initial=0.0))
    gamma = problem.work_of_adhesion
    if beyond_limit(math.inf, loss, gamma, largest):
        ratio = loss / (gamma * largest)
        out.append(
            f"the loss is {ratio:.3g} times the work of adhesion of the largest contact, more "
            f"than the {DOUBTFUL_LOSS:g} that adhesion explains: it is elastic energy of valleys "
            "that the rule against opening inside a contact holds closed (docs/zero-range.md)"
        )
    return out
