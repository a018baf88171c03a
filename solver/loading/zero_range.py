"""Compute the four ranges of adhesion that bound the zero-range model (docs/zero-range.md).

    valid_range = γ/σ_in                    nothing opens inside patches below it
    edge_range  = sqrt(4 γ l/(π E*))        a cohesive zone (π/4) E* δ²/γ at an edge is as long as l
    touch_range = 0.01 loss / Σ |Δp̄|        earlier touches lose a hundredth; Σ over all touches
    turn_range                              within it jumps beyond a turning point lose a hundredth

σ_in is the largest local maximum of tension inside patches, away from their edges, and l the
narrowest length that decides where edges stand: the least of λ_min and of the patches and gaps
beside the edges that move in the jumps which make up nine tenths of all drops, as long as these are
before the jump. A loop of a finite range has earlier touches in it, and its ``touch_range`` is
infinite.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.loading.mean_stress_event import before_jumps
from adhesis.solver.loading.path_record import Record
from adhesis.solver.method import ContactState, Method, PathError
from adhesis.solver.model.control import Control
from adhesis.solver.model.jump import Branch, Jump, JumpKind
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array

RANGES = ("valid_range", "edge_range", "touch_range", "turn_range")
"""Names of the four ranges, as properties of a result and in rows of a results file."""

ANY_RANGE = f"{', '.join(RANGES[:-1])} or {RANGES[-1]}"
"""Their names in a sentence."""

DOUBTFUL_RANGE = 1e-9
"""Least of the four ranges below which a loss is doubtful, in m: adhesion has 0.2 to 10 nm."""

TOUCHES: frozenset[JumpKind] = frozenset({"snap-in", "merging"})
"""Kinds of the jumps in which surfaces come into contact away from edges, or a gap closes."""

TOUCH_SHARE = 0.01
"""Share of the loss that is lost at ``touch_range``, and beyond the turn at ``turn_range``."""

DOUBTFUL_LOSS = 20.0
"""Loss over γ A_max/A0 above which a loss is doubtful (docs/zero-range.md)."""

DOUBTFUL_EXCESS = 1.01
"""Tension inside patches over a finite strength above which a loss is doubtful."""

SMEARED = 0.05
"""Share of the loss of zero range that cohesive zones at edges change, over (δ/``edge_range``)⁴:
0.04 to 0.06 beside exact waves under Dugdale's law (docs/zero-range.md)."""

EDGE_SHARE = (TOUCH_SHARE / SMEARED) ** 0.25
"""Of ``edge_range``: at a longer range that is given, zones at edges change a hundredth or more."""

# Number of jumps of unloading before which tension is searched, those with the largest drops: where
# tension is largest, contact is lost with a large drop. And number of states of the whole path.
_JUMPS, _SAMPLES = 16, 6
_MOST_OF_LOSS = 0.9
_OF_GAP = 0.99  # of the mean gap at a turning point: nearer to full contact no jump is sought
_OF_STEP = 1e-3  # of the load step: the shortest with which the end of a path is sought
_SAME = 1e-9  # of the period: edges that differ by less have not moved


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
    searched, and six states evenly spaced on the path; at a finite strength all states. Without
    adhesion nothing is in tension.
    """
    if method.problem.work_of_adhesion == 0:
        return None
    is_limit = math.isinf(method.problem.strength)
    indices = _sampled(record) if is_limit else list(range(len(record.states)))
    indices = [index for index in indices if record.states[index].patches]
    found = method.largest_tension([record.states[index] for index in indices])
    if found is None:
        return None
    index = indices[found.state]
    separation = record.states[index].separation
    return InteriorTension(
        tension=found.tension,
        position=found.position,
        branch=record.branches[index],
        penetration=float(method.problem.penetration(separation)),
    )


def _sampled(record: Record) -> list[int]:
    """Return the indices of the states that are searched with zero range."""
    before = zip(record.jumps, before_jumps(record.states, record.jumps), strict=True)
    starts = sorted((-jump.energy_drop, i) for jump, i in before if jump.branch == "unloading")
    spaced = np.linspace(0, len(record.states) - 1, _SAMPLES + 2)[1:-1].astype(int)
    return sorted({*(index for _, index in starts[:_JUMPS]), *spaced.tolist()})


def narrowest_length(problem: Problem, record: Record) -> float:
    """Return the shortest length in m that decides where edges stand; see the module."""
    shortest = problem.shortest_wavelength
    starts = zip(record.jumps, before_jumps(record.states, record.jumps), strict=True)
    order = sorted(starts, key=lambda one: -one[0].energy_drop)
    rest = _MOST_OF_LOSS * sum(jump.energy_drop for jump, _ in order)
    for jump, index in order:
        if rest <= 0:
            break
        rest -= jump.energy_drop
        before, after = record.states[index].edges, record.states[index + 1].edges
        shortest = min(shortest, _narrowest_moved(before, after, problem.profile.period))
    return shortest


def _narrowest_moved(before: Array, after: Array, period: float) -> float:
    """Return the least length of the patches and gaps of ``before`` beside edges that move."""
    if not len(before):
        return math.inf
    edges, others = before.ravel() % period, np.sort(after.ravel() % period)
    moved = np.ones(edges.shape, dtype=bool)
    if len(others):
        others = np.concatenate([others[-1:] - period, others, others[:1] + period])
        right = np.searchsorted(others, edges)  # others lie on both sides
        nearest = np.minimum(np.abs(edges - others[right - 1]), np.abs(edges - others[right]))
        moved = nearest > _SAME * period
    patch = before[:, 1] - before[:, 0]
    gap = np.append(before[1:, 0], before[0, 0] + period) - before[:, 1]  # right of each patch
    left, right_ = moved.reshape(-1, 2).T
    lengths = (patch[left | right_], gap[right_], np.roll(gap, 1)[left])
    return float(np.concatenate(lengths).min(initial=math.inf))


def touch_stress(
    jumps: Sequence[Jump],
    before: Sequence[int],
    separation: Array,
    mean_stress: Array,
    patches: NDArray[np.int64],
    control: Control,
) -> float:
    """Add up |Δp̄| over all touches, in Pa: how fast the loss falls with the range of adhesion.

    Surfaces touch earlier by the range in s, hence by dx/ds times that in the prescribed value x,
    and the loss falls by the change of its conjugate Y times that. At fixed separation that is
    |Δp̄|. Otherwise dx/ds is that between the state before the jump and the one before that; before
    first touch it is 1, and 0 under a load, which then moves nothing but the solid.

    ``before`` has the index of the state before each jump; the arrays have the shape (states,).
    """
    x = control.prescribed(separation, mean_stress)
    y = control.conjugate(separation, mean_stress, 0.0)
    total = 0.0
    for jump, k in zip(jumps, before, strict=True):
        if jump.kind not in TOUCHES:
            continue
        rate = 0.0 if control.is_load and not patches[k] else 1.0
        if not control.is_fixed and patches[k]:
            earlier = np.flatnonzero(separation[:k] != separation[k])
            if len(earlier):
                i = earlier[-1]
                rate = abs(float((x[k] - x[i]) / (separation[k] - separation[i])))
        total += rate * abs(float(y[k + 1] - y[k]))
    return total


def turn_range(method: Method, record: Record, step: float, lost: float, longest: float) -> float:
    """Find the way in m beyond a turning point in which jumps take a hundredth of the loss.

    Each leg of loading is followed beyond its end, where the path turns or ends. Where it cannot be
    followed so far, or full contact is near, the way up to there counts: nothing is known beyond.
    The least over the turning points is returned; infinite if it is longer than ``longest``, in m.
    ``step`` is the load step in the prescribed value, positive, ``lost`` the loss in J/m².
    """
    if method.problem.work_of_adhesion == 0:
        return math.inf
    following = [*record.branches[1:], "unloading"]
    turns = [
        state
        for branch, after, state in zip(record.branches, following, record.states, strict=True)
        if (branch, after) == ("loading", "unloading")
    ]
    least = min(_way_beyond(method, state, step, TOUCH_SHARE * lost, longest) for state in turns)
    return least if least < longest else math.inf


def _way_beyond(
    method: Method, state: ContactState, step: float, most: float, longest: float
) -> float:
    """Return the way of :func:`turn_range` beyond one state; jumps take ``most`` there."""
    problem, turn = method.problem, state.separation
    x, farthest = problem.prescribed_in(state), min(longest, _OF_GAP * turn)
    fixed, end, shortest = problem.control.is_fixed, turn - farthest, _OF_STEP * step
    # what is prescribed ends a path at fixed separations: that of a state may be off by rounding
    while (x if fixed else state.separation) > end:
        try:
            path = method.follow(state, max(x - step, end) if fixed else x - step)
        except PathError:
            step /= 4
            if step < shortest:
                return turn - state.separation
            continue
        x = max(x - step, end) if fixed else x - step
        for jump in path.jumps:
            most -= max(0.0, jump.energy_drop)
            if most < 0:
                return turn - jump.separation
        step, state = 2 * step, path.states[-1]  # under a load it falls ever more slowly
    return farthest


def least_range(*ranges: Any) -> NDArray[np.float64]:
    """Return the least of the four ranges, in m; one that is unknown (NaN) does not count."""
    found = np.fmin.reduce(np.array(np.broadcast_arrays(*ranges), dtype=np.float64))
    return np.asarray(found, dtype=np.float64)


def limit_text(
    inside: str, valid_range: float, edge_range: float, touch_range: float, turn_range: float
) -> str:
    """Return in one line for which ranges of adhesion in m the zero-range limit holds.

    ``inside`` says what is known of the tension inside patches, which sets ``valid_range``.
    """
    if math.isfinite(valid_range):
        inside += f": {length_text(valid_range)}"
    least = float(least_range(valid_range, edge_range, touch_range, turn_range))
    known = "; ".join(filter(None, (inside, outside_text(edge_range, touch_range, turn_range))))
    return (
        "the zero-range model is valid if the real adhesion reaches less than "
        f"{length_text(least)} ({known})"
    )


def outside_text(edge_range: float, touch_range: float, turn_range: float) -> str:
    """Return the finite ones of the ranges in m that hold elsewhere than inside patches."""
    named = {"at edges": edge_range, "at touches": touch_range, "beyond the turn": turn_range}
    known = {name: bound for name, bound in named.items() if math.isfinite(bound)}
    return "; ".join(f"{name}: {length_text(bound)}" for name, bound in known.items())


def length_text(metres: float) -> str:
    """Return a range of adhesion in a unit of its size: "17.5 nm"."""
    return f"{1e6 * metres:.3g} µm" if metres >= 1e-6 else f"{1e9 * metres:.3g} nm"


def stress_text(pascals: float) -> str:
    """Return a stress in a unit of its size: "100 kPa"."""
    return f"{1e-6 * pascals:.3g} MPa" if pascals >= 1e6 else f"{1e-3 * pascals:.3g} kPa"


def stored_at_pull_off(tension: Any, stiffness: float) -> Any:
    """Compute the energy p̄²/(2k) in J/m² that what holds the solid loses with it at pull-off.

    Nothing at a fixed separation (k is infinite), nor under a load, where no energy is stored.
    """
    return tension**2 / (2 * stiffness) if stiffness else 0.0


def beyond_limit(
    valid_range: Any,
    loss: Any,
    work_of_adhesion: Any,
    largest_contact_fraction: Any,
    strength: Any = math.inf,
    edge_range: Any = math.inf,
    touch_range: Any = math.inf,
    turn_range: Any = math.inf,
    work_of_adhesion_open: Any = 0.0,
) -> NDArray[np.bool_]:
    """Mark the losses that an adhesion of finite range may not have; values or arrays of one shape.

    The least of their ranges is below :data:`DOUBTFUL_RANGE`, or they are more than
    :data:`DOUBTFUL_LOSS` times the work of adhesion of the largest contact, at which its edges
    recede. At a finite strength it is those whose own range of adhesion, γ over the strength, is
    longer than edges, touches or turns allow, and those at which the tension inside patches exceeds
    the strength :data:`DOUBTFUL_EXCESS` times. None is where the strength is unknown (NaN).
    """
    loss, gamma = np.asarray(loss), np.asarray(work_of_adhesion)
    valid_range, is_limit = np.asarray(valid_range), np.isposinf(strength)
    strength = np.where(is_limit, np.nan, strength)  # unknown to what follows of a finite one
    spent = np.fmax(gamma, work_of_adhesion_open)
    most = DOUBTFUL_LOSS * spent * np.asarray(largest_contact_fraction)
    short = least_range(valid_range, edge_range, touch_range, turn_range) < DOUBTFUL_RANGE
    closed = (short | (loss > most)) & (gamma > 0)
    exceeded = gamma > DOUBTFUL_EXCESS * strength * valid_range
    edges = EDGE_SHARE * np.asarray(edge_range)
    long = gamma > strength * least_range(math.inf, edges, touch_range, turn_range)
    return np.asarray(np.where(is_limit, closed, np.isfinite(strength) & (exceeded | long)))


_WHAT_A_LONGER_RANGE_DOES = {
    "valid_range": "patches would open from inside and lose less",
    "edge_range": "edges would give way over zones that are not short",
    "touch_range": "surfaces would jump into contact from further away and lose less",
    "turn_range": "jumps that lie just beyond the turning point would come before it",
}


def range_warnings(
    problem: Problem,
    range_: float,
    loss: float,
    contact_fraction: Sequence[float] | Array,
    edge_range: float = math.inf,
    touch_range: float = math.inf,
    turn_range: float = math.inf,
) -> list[str]:
    """Return warnings if a loss is that of the zero-range limit alone.

    At a finite strength touches come earlier; doubtful is then a tension inside patches that
    exceeds it, and a range of adhesion that edges or turns do not allow. ``range_`` is
    ``valid_range``, ``loss`` that without what a stiffness stores at pull-off.
    """
    out: list[str] = []
    bounds = {"edge_range": edge_range, "touch_range": touch_range, "turn_range": turn_range}
    gamma = problem.work_of_adhesion
    if math.isfinite(problem.strength):
        largest_tension = gamma / range_
        excess = largest_tension / problem.strength
        if excess > DOUBTFUL_EXCESS:
            out.append(
                f"the tension inside patches reaches {largest_tension:.3g} Pa, {excess:.3g} times "
                f"the strength ({problem.strength:.3g} Pa): patches would open from inside there, "
                "which the method 'sharp' leaves out; take the method 'zones' (--method zones, "
                'method = "zones"; docs/zero-range.md)'
            )
        own = gamma / problem.strength
        shares = {"edge_range": EDGE_SHARE, "touch_range": 1.0, "turn_range": 1.0}
        least = min(bounds, key=lambda name: shares[name] * bounds[name])
        if own > shares[least] * bounds[least]:
            share = "" if shares[least] == 1 else f"{shares[least]:.2g} of "
            out.append(
                f"the range of adhesion, {1e9 * own:.3g} nm, is longer than {share}{least}, "
                f"{1e9 * bounds[least]:.3g} nm: {_WHAT_A_LONGER_RANGE_DOES[least]}, which the "
                "method 'sharp' leaves out; take the method 'zones' (docs/zero-range.md)"
            )
        return out
    bounds = {"valid_range": range_, **bounds}
    least = min(bounds, key=lambda name: bounds[name])
    if bounds[least] < DOUBTFUL_RANGE and gamma > 0:
        out.append(
            f"{least} is {1e9 * bounds[least]:.3g} nm: the zero-range limit holds only for ranges "
            f"of adhesion below it, and below {1e9 * DOUBTFUL_RANGE:g} nm hardly any interface has "
            f"one, so {_WHAT_A_LONGER_RANGE_DOES[least]} (docs/zero-range.md)"
        )
    largest = float(np.max(contact_fraction, initial=0.0))
    spent = problem.gamma_open
    if beyond_limit(math.inf, loss, spent, largest):
        ratio = loss / (spent * largest)
        control = problem.control
        held = "" if control.is_fixed or control.is_load else ", without p̄²/(2k) at pull-off,"
        out.append(
            f"the loss{held} is {ratio:.3g} times the work of adhesion of the largest contact, "
            f"more than the {DOUBTFUL_LOSS:g} that adhesion explains: it is elastic energy of "
            "valleys that the rule against opening inside a contact holds closed "
            "(docs/zero-range.md)"
        )
    return out
