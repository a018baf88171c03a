"""Follow a path until its mean stress, or another value of a state, reaches a given one.

The mean stress is not monotone along a path of prescribed separation, and jumps change it at once.
It reaches a value in the first state, on a stable branch or at the end of a jump, in which it is at
least that value (at most, while it falls). On a stable branch that state is located with the
method's own states; a jump that goes beyond the value ends beyond it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from adhesis.solver.loading.ledger import states_before_jumps
from adhesis.solver.method import ContactState, Method, Path, PathError
from adhesis.solver.model.jump import Jump

Excess = Callable[[ContactState], float]
"""Value of a state less the wanted one, with the sign with which it is reached from below 0."""

REACHED = 1e-9
"""Relative difference below which the mean stress has reached a value: the field is less exact."""

# Share of the range of the control to which a state is located: the mean stress of a method whose
# edges move from node to node has steps, of which the first that is high enough is taken.
_LOCATED = 1e-12
# Share of h_max to which the end of a path is located beyond which there is no state.
_END_LOCATED = 1e-6


def follow_to_stress(
    method: Method, state: ContactState, prescribed: float, stress: float
) -> tuple[Path, bool]:
    """Follow the path to a prescribed value in m, or up to where p̄ has risen to ``stress`` in Pa.

    The state has a smaller mean stress, and the last one of the path is the one that reaches the
    stress, or that at the prescribed value. Returns also whether the stress is reached.

    Raises
    ------
    PathError
        If the path cannot be followed so far, and does not reach the stress before.
    """
    start = method.problem.prescribed_in(state)
    try:
        path = method.follow(state, prescribed)
    except PathError as error:
        # the stress may be reached before the path ends
        if abs(prescribed - start) < _END_LOCATED * method.problem.profile.h_max:
            raise PathError(
                f"{error}; the mean stress before that is {state.mean_stress:.4g} Pa, less than "
                "the preload"
            ) from error
        first, reached = follow_to_stress(method, state, 0.5 * (start + prescribed), stress)
        if reached:
            return first, True
        second, reached = follow_to_stress(method, first.states[-1], prescribed, stress)
        return _joined(first, second), reached
    return up_to(method, state, path, lambda passed: passed.mean_stress / stress - 1.0)


def has_reached(mean_stress: float, stress: float) -> bool:
    """Return whether a mean stress is at least ``stress`` (Pa, positive)."""
    return mean_stress / stress - 1.0 >= -REACHED


def up_to(method: Method, state: ContactState, path: Path, excess: Excess) -> tuple[Path, bool]:
    """Return a path that was followed from ``state``, up to where the excess reaches 0, if it does.

    It ends where the excess is 0, or after the jump that goes beyond; otherwise it is the given
    one. Returns also whether the excess reaches 0.
    """
    states = (state, *path.states)
    k = next((k for k in range(1, len(states)) if excess(states[k]) >= -REACHED), None)
    if k is None:
        return path, False
    if k - 1 in before_jumps(states, path.jumps) or excess(states[k]) <= REACHED:
        return _first(path, k, states), True
    located = locate(method, states[k - 1], states[k], excess)
    return _joined(_first(path, k - 1, states), located), True


def locate(method: Method, start: ContactState, end: ContactState, excess: Excess) -> Path:
    """Follow the stable branch from ``start`` towards ``end`` to the state whose excess is 0.

    The states are neighbours on a stable branch, with an excess below 0 and above 0.
    """
    from scipy.optimize import brentq  # commands that follow no path do not load it

    problem = method.problem
    x = problem.prescribed_in(start), problem.prescribed_in(end)
    known = {x[0]: excess(start), x[1]: excess(end)}
    found: dict[float, Path] = {}

    def excess_at(prescribed: float) -> float:
        if prescribed not in known:
            path = method.follow(start, prescribed)
            states = (start, *path.states)
            first = next((k for k in range(1, len(states)) if excess(states[k]) >= 0), None)
            path = path if first is None else _first(path, first, states)
            found[prescribed], known[prescribed] = path, excess(path.states[-1])
        value = known[prescribed]
        return 0.0 if abs(value) <= REACHED else value

    near = _LOCATED * problem.prescribed_range
    root = brentq(excess_at, *x, xtol=near, rtol=1e-15) if x[0] != x[1] else x[1]
    if known.get(root, -1.0) < -REACHED:  # the other end of the last bracket has reached it
        root = min((p for p in known if known[p] >= 0), key=lambda p: abs(p - x[0]))
    return found.get(root, Path((end,), (), 0.0))


def before_jumps(states: Sequence[ContactState], jumps: Sequence[Jump]) -> list[int]:
    """Return the index of the state before each jump of a path; the next one is that after it."""
    separation = np.array([state.separation for state in states])
    contact = np.array([state.contact_fraction for state in states])
    return states_before_jumps(jumps, separation, contact)


def _first(path: Path, count: int, states: Sequence[ContactState]) -> Path:
    """Return the first ``count`` states of a path, with their jumps; its error is a bound."""
    jumps = sum(before < count for before in before_jumps(states, path.jumps))
    return replace(path, states=path.states[:count], jumps=path.jumps[:jumps])


def _joined(first: Path, second: Path) -> Path:
    return Path(
        first.states + second.states, first.jumps + second.jumps, first.error + second.error
    )
