"""Make what ``adhesis loop`` writes: the JSON of a loop, the fields at chosen penetrations.

How files are written is in :mod:`adhesis.ensemble.outputs`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.outputs import whole_file
from adhesis.ensemble.quantities import in_works_of_adhesion
from adhesis.solver.checks import counted
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.loop_state import LoopState
from adhesis.solver.loading.path import MinorLoop, PathResult
from adhesis.solver.method import BRANCHES, Branch, ContactState, Method


def loop_document(result: LoopResult | PathResult) -> dict[str, Any]:
    """Return the JSON document of a loop or path; see the README for its keys and units.

    The states of a loop are there twice: ``states`` is a list of objects, one per state, and each
    of its keys is also a list of its own at the top level, for readers that want columns.
    """
    columns = {name: values.tolist() for name, values in result.columns().items()}
    interior, details = result.interior, asdict(result.method)
    del details["name"]
    document = {
        **result.numbers(),
        **_displacement(result),
        "interior_tension": None if interior is None else asdict(interior),
        "loss_note": result.loss_note,
        "warnings": list(result.warnings),
        "method_details": {key: _plain(value) for key, value in details.items()},
        "jumps": result.jump_rows(),
        **columns,
    }
    if isinstance(result, PathResult):
        return document | {
            "turning_points": list(result.turning_points),
            "out": result.ends_out,
            "minor_loops": [
                asdict(part) | {"audit_residual": part.audit_residual}
                for part in result.minor_loops
            ],
        }
    rows = zip(*columns.values(), strict=True)
    return document | {"states": [dict(zip(columns, row, strict=True)) for row in rows]}


def document(
    results: Sequence[LoopResult] | PathResult, warnings: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the JSON document of a path, or of loops with ascending turning points.

    That of the last loop, and where there are several all of them, in order, as ``turns``. The keys
    of a path are those of a loop where they mean the same. ``warnings`` of the input stand before
    those of each result.
    """
    several = [results] if isinstance(results, PathResult) else results
    documents = [loop_document(result) for result in several]
    for one in documents:
        one["warnings"] = [*warnings, *one["warnings"]]
    return documents[-1] | ({"turns": documents} if len(documents) > 1 else {})


def _displacement(result: LoopResult | PathResult) -> dict[str, Any]:
    """Path of the far side in h_max; none at fixed separation."""
    control, h_max = result.problem.control, result.problem.profile.h_max
    if control.is_fixed:
        return {}
    far = control.displacement(result.separation, result.mean_stress, h_max)
    return {"displacement": (far / h_max).tolist()}


def summary(result: LoopResult | PathResult) -> str:
    """Return a loop or path in a few lines for the terminal."""
    return "\n".join(f"{name:<12}{text}" for name, text in summary_rows(result))


def summary_rows(result: LoopResult | PathResult) -> list[tuple[str, str]]:
    """Return the main numbers of a loop or path, each with its name."""
    problem, profile, half_space = result.problem, result.problem.profile, result.problem.half_space
    present = np.flatnonzero(profile.coefficients)
    counts = Counter(jump.kind for jump in result.jumps)
    kinds = ", ".join(f"{count} {kind}" for kind, count in counts.most_common()) or "none"
    measure = "" if problem.measure == "arc" else f"{problem.measure} measure, "
    note = f"; {result.loss_note}" if result.loss_note else ""
    contact = (
        f"largest contact fraction {result.contact_fraction.max():.4g}, most patches "
        f"{result.patches.max()}"
    )
    rows = [
        (
            "profile",
            f"period {profile.period:.6g} m, harmonics {present[0]} to {present[-1]}, "
            f"h_rms {profile.h_rms:.4g} m, h_max {profile.h_max:.4g} m, m2 {profile.m2:.4g}",
        ),
        (
            "contact",
            f"E {half_space.young:.4g} Pa, nu {half_space.poisson:.3g}, "
            f"work of adhesion {problem.adhesion_text}",
        ),
    ]
    if isinstance(result, PathResult):
        way = ", ".join(map(str, result.turning_points))
        out = ", out" if result.ends_out else ""
        share = in_works_of_adhesion(result.work, problem.work_of_adhesion)
        stored = f"of which {result.energy_change:.6g} J/m² are stored"
        rows += [
            ("path", f"{way}{out} in {result.load_steps} load steps to the largest; {contact}"),
            ("work", f"{result.work:.6g} J/m²{share}, {stored}{note}"),
        ]
    else:
        share = in_works_of_adhesion(result.loss, problem.work_of_adhesion)
        rows += [
            (
                "cycle",
                f"{_turn(result)} in {result.load_steps} load steps, detached by "
                f"{result.pull_off_penetration:.4g} h_max; {contact}",
            ),
            (
                "loss",
                f"{result.loss:.6g} J/m²{share} (dimensionless {result.loss_dimensionless:.6g})"
                f"{note}",
            ),
        ]
    rows += [
        ("friction", result.friction_summary()),
        ("sticking", result.sticking_note),
        ("range", result.range_summary()),
        ("audit", _audit(result)),
        (
            "error",
            f"{result.loss_error:.2g} J/m² (numerical); {counted(result.races, 'jump')} raced, "
            f"{result.energy_at_stake:.3g} J/m² at stake",
        ),
        ("jumps", kinds),
    ]
    if isinstance(result, PathResult):
        rows += [("minor loop", _minor_loop(part)) for part in result.minor_loops]
    else:
        rows.append(("pull-off", f"mean tension {result.pull_off_stress + 0.0:.6g} Pa"))
    rows.append(("method", f"{result.method.name}, {measure}{result.seconds:.1f} s"))
    return [(name, text) for name, text in rows if text]


def _minor_loop(part: MinorLoop) -> str:
    end = (
        "comes back to the same state"
        if part.closes
        else f"ends {part.stress_change:+.3g} Pa and {part.contact_change:+.3g} A/A0 away"
    )
    return (
        f"{part.start:g}, {part.turn:g}, {part.start:g}: {part.loss:.6g} J/m² "
        f"(drops {part.loss_from_drops:.6g}), {end}"
    )


def _audit(result: LoopResult | PathResult) -> str:
    """Return the audit; without adhesion there is no loss that a residual could refer to."""
    friction = " and the friction between them" if result.problem.pinning > 0 else ""
    jumps = f"{counted(len(result.jumps), 'jump')}{friction}"
    drops = f"{result.loss_from_drops:.6g} J/m² in {jumps}"
    if result.problem.work_of_adhesion == 0:
        return f"{drops}; without adhesion nothing is lost"
    return f"{drops}, residual {result.audit_residual:.2e}"


def _turn(result: LoopResult) -> str:
    control = result.problem.control
    if result.preload is not None:
        held = "" if control.is_fixed else f"held by {control.stiffness:.4g} Pa/m, "
        reached = "" if control.is_fixed else f" (penetration {result.max_penetration:.4g} h_max)"
        return f"{held}turning at {result.turning_text}{reached}"
    if control.is_load:
        return f"under a load to {result.turning_point:g} Pa"
    if control.is_fixed:
        return f"to penetration {result.max_penetration:g} h_max"
    return (
        f"held by {control.stiffness:.4g} Pa/m, far side to {result.turning_point:g} h_max "
        f"(penetration {result.max_penetration:.4g} h_max)"
    )


def _plain(value: Any) -> Any:
    """Return ``value`` with numpy numbers and arrays as the JSON types."""
    return (
        value.item() if isinstance(value, np.generic) else getattr(value, "tolist", lambda: value)()
    )


# ---------------------------------------------------------------------- fields


def fields_at_penetrations(
    loop: LoopResult, method: Method, penetrations: Sequence[float], n: int
) -> dict[str, Any]:
    """Return the fields on n nodes at penetrations Δ/h_max of both branches, as arrays.

    ``branch`` and ``penetration`` have shape (k,), ``x`` and ``height`` (n,), ``stress``,
    ``displacement`` and ``gap`` (k, n), ``edges`` (k, most patches, 2) with NaN for none.
    """
    found = []
    for branch in BRANCHES:
        states = [loop.contact_states[k] for k in loop.states(branch)]
        for wanted in penetrations:
            state = _state_at(method, branch, states, wanted)
            found.append(LoopState(branch, False, wanted, state, method))
    return _arrays(found, n)


def _state_at(
    method: Method, branch: Branch, states: Sequence[ContactState], wanted: float
) -> ContactState:
    """Return the state of a branch at a penetration: one of its own, or one followed from there."""
    separation = method.problem.separation(wanted)
    before = None
    for k, state in enumerate(states):
        if state.patches and state.separation == separation:
            return state
        here = method.problem.penetration(state.separation)
        if before is None and (here >= wanted if branch == "loading" else here <= wanted):
            before = states[max(k - 1, 0)]
    if before is None or (branch == "unloading" and not before.patches):
        return method.detached(separation)
    return method.follow(before, separation).states[-1]


def fields_at_stresses(loop: LoopResult, stresses: Sequence[float], n: int) -> dict[str, Any]:
    """Return the fields on n nodes at mean stresses in Pa, as :func:`fields_at_penetrations`.

    A branch that does not have a mean stress is left out; InputError if neither branch has it.
    """
    found = []
    absent = dict.fromkeys(stresses, 0)
    for branch in BRANCHES:
        for wanted in stresses:
            try:
                found.append(loop.at_stress(wanted, branch))
            except ValueError as error:
                absent[wanted] += 1
                if absent[wanted] == len(BRANCHES):
                    raise InputError(f"--field-stresses: {error}") from None
    return _arrays(found, n)


def _arrays(found: Sequence[LoopState], n: int) -> dict[str, Any]:
    edges = np.full((len(found), max(one.state.patches for one in found), 2), np.nan)
    for row, one in zip(edges, found, strict=True):
        row[: one.state.patches] = one.edges
    fields = [one.fields(n) for one in found]
    of_states = ("branch", "penetration", "separation", "mean_stress")
    return {
        **{name: np.array([getattr(one, name) for one in found]) for name in of_states},
        "x": fields[0].x,
        "height": fields[0].height,
        **{
            name: np.array([getattr(one, name) for one in fields])
            for name in ("stress", "displacement", "gap")
        },
        "edges": edges,
    }


def write_npz(path: Path, arrays: dict[str, Any]) -> None:
    """Write arrays as a compressed .npz, whole or not at all (OSError)."""
    save: Callable[..., None] = np.savez_compressed
    with whole_file(path) as stream:
        save(stream, **arrays)
