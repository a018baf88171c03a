"""Frames of a film: which states of a result are shown, and what is shown of each.

Every jump has a frame before it and one after it, as far as the number of frames allows.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from adhesis.ensemble.loop.record import Result
from adhesis.solver.checks import Bounds, counted, function, whole
from adhesis.solver.method import ContactState, Method
from adhesis.solver.model.jump import Jump
from adhesis.solver.model.profile import Array

MOST_FRAMES = 1000
_FRAMES = Bounds(2, MOST_FRAMES, whole=True)
_NODES = 800  # of the drawn surface: about one a pixel


@dataclass(frozen=True)
class Scene:
    """One frame."""

    state: int  # number of the state in the result
    surface: Array  # height above the profile's mean line in m, shape (nodes,)
    patches: Array  # ends in m, shape (patches, 2), within the period; one across its end is two
    caption: str  # the state in numbers
    announcement: str  # the jumps since the frame before; empty without any
    is_notable: bool  # whether those jumps lose a hundredth of all drops or more


@dataclass(frozen=True)
class Scenes:
    """All frames of a film."""

    x: Array  # positions in m from 0 to the period, both included, shape (nodes,)
    height: Array  # of the rigid profile there, in m
    scenes: list[Scene]  # in the order of the path
    jumps_shown: int  # jumps that have a frame before and one after them


def scenes_of(
    result: Result, frames: int, progress: Callable[[int, int], None] | None = None
) -> Scenes:
    """Compute the frames of a result: evenly spaced ones, and on top those of jumps.

    ``progress`` is called with the numbers of frames done and in all. ValueError if ``frames`` is
    out of range, or the result holds no contact states.
    """
    frames = whole("frames", frames, _FRAMES)
    function("progress", progress)
    if not result.contact_states or result.new_method is None:
        raise ValueError(
            "this result holds no contact states, as it was read from a file: run the loop again "
            "to film it"
        )
    method = result.new_method()
    profile = result.problem.profile
    x = np.linspace(0.0, profile.period, _NODES)
    height = profile.at(x)
    places = result.states_before_jumps()
    chosen, shown = _chosen(result, places, frames)
    scenes = []
    last = -1
    for done, index in enumerate(chosen, 1):
        state = result.contact_states[index]
        since = [j for j, p in zip(result.jumps, places, strict=True) if last <= p < index]
        before = sum(p < index for p in places)
        shapes = _surface(method, state, x, height), _patches(state, profile.period)
        texts = _caption(result, index, before), _announcement(since)
        is_notable = _drop(since) > 0.01 * _drop(result.jumps)
        scenes.append(Scene(index, *shapes, *texts, is_notable))
        last = index
        if progress is not None:
            progress(done, len(chosen))
    return Scenes(x, height, scenes, shown)


def _chosen(result: Result, places: Sequence[int], frames: int) -> tuple[list[int], int]:
    """Numbers of the states that are shown, and of how many jumps."""
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(result.penetration)))])
    even = np.searchsorted(way, np.linspace(0.0, way[-1], frames))
    chosen = {0, len(way) - 1, *np.minimum(even, len(way) - 1).tolist()}
    order = sorted(range(len(places)), key=lambda k: -result.jumps[k].energy_drop)
    shown = 0
    for k in order:
        more = chosen | {places[k], places[k] + 1}
        if len(more) > MOST_FRAMES:
            break
        chosen = more
        shown += 1
    return sorted(chosen), shown


def _surface(method: Method, state: ContactState, x: Array, height: Array) -> Array:
    """Return the surface h + t: the gap t from the opening of each gap, on the circle."""
    if not state.patches:
        return np.full(x.size, state.separation)
    gap = np.zeros(x.size)
    period = method.problem.profile.period
    for opening in method.openings(state):
        for turn in (0.0, period):
            inside = (x + turn > opening.x[0]) & (x + turn < opening.x[-1])
            gap[inside] = np.interp(x[inside] + turn, opening.x, opening.gap)
    return np.asarray(height + gap)


def _patches(state: ContactState, period: float) -> Array:
    parts = []
    for left, right in state.edges:
        if right > period:
            parts += [(left, period), (0.0, right - period)]
        else:
            parts.append((left, right))
    return np.array(parts).reshape(-1, 2)


def _drop(jumps: Sequence[Jump]) -> float:
    return float(sum(jump.energy_drop for jump in jumps))


def _caption(result: Result, index: int, jumps: int) -> str:
    lost = _drop(result.jumps[:jumps])
    patches = counted(int(result.patches[index]), "patch")
    return (
        f"{result.branch[index]}: Δ/h_max {result.penetration[index]:.3f}, mean stress "
        f"{result.mean_stress[index]:.4g} Pa, A/A0 {result.contact_fraction[index]:.3f}, "
        f"{patches}; {jumps} of {counted(len(result.jumps), 'jump')} so far "
        f"lost {lost:.3g} J/m²"
    )


def _announcement(jumps: Sequence[Jump]) -> str:
    if not jumps:
        return ""
    if len(jumps) == 1:
        return f"jump ({jumps[0].kind}): energy drop {jumps[0].energy_drop:.3g} J/m²"
    kinds = Counter(jump.kind for jump in jumps)
    several = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
    return f"{len(jumps)} jumps ({several}): energy drops {_drop(jumps):.3g} J/m² in all"
