"""Make what ``adhesis loop`` writes: the JSON of a loop, the fields at chosen penetrations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from itertools import product
from typing import Any

import numpy as np

from adhesis.ensemble.errors import InputError
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.loop_state import LoopState
from adhesis.solver.loading.path import PathResult
from adhesis.solver.method import BRANCHES, Branch, Method

Result = LoopResult | PathResult


def loop_document(result: Result) -> dict[str, Any]:
    """Return the JSON document of a loop or path; commands add a ``provenance`` with units.

    The states of a loop are there twice: ``states`` is a list of objects, one per state, and each
    of its keys is also a list of its own at the top level, for readers that want columns.
    """
    columns = {name: values.tolist() for name, values in result.columns().items()}
    interior, details = result.interior, asdict(result.method).items()
    plain = {k: v.tolist() if hasattr(v, "tolist") else v for k, v in details if k != "name"}
    control, h_max = result.problem.control, result.problem.profile.h_max
    displacement = {}
    if not control.is_fixed:  # path of the far side in h_max
        far = control.displacement(result.separation, result.mean_stress, h_max)
        displacement["displacement"] = (far / h_max).tolist()
    document = {
        **result.numbers(),
        **displacement,
        "interior_tension": None if interior is None else asdict(interior),
        "loss_note": result.loss_note,
        "warnings": list(result.warnings),
        "method_details": plain,
        "jumps": result.jump_rows(),
        **columns,
    }
    if isinstance(result, PathResult):
        loops = [asdict(p) | {"audit_residual": p.audit_residual} for p in result.minor_loops]
        turns, out = list(result.turning_points), result.ends_out
        return document | {"turning_points": turns, "out": out, "minor_loops": loops}
    rows = zip(*columns.values(), strict=True)
    return document | {"states": [dict(zip(columns, row, strict=True)) for row in rows]}


def document(results: Sequence[Result], warnings: Sequence[str] = ()) -> dict[str, Any]:
    """Return the JSON document of one path, or of loops with ascending turning points.

    That of the last loop, and where there are several all of them, in order, as ``turns``. The keys
    of a path are those of a loop where they mean the same. ``warnings`` of the input stand before
    those of each result.
    """
    documents = [loop_document(result) for result in results]
    for one in documents:
        one["warnings"] = [*warnings, *one["warnings"]]
    return documents[-1] | ({"turns": documents} if len(documents) > 1 else {})


def fields_of(
    loop: LoopResult, method: Method, wanted: Sequence[float], at_stresses: bool, n: int
) -> dict[str, Any]:
    """Return the fields on n nodes of states of both branches, as arrays.

    The states are those at mean stresses in Pa, or at penetrations Δ/h_max. A branch that does not
    have a mean stress is left out; InputError if neither branch has it.

    ``branch`` and ``penetration`` have shape (k,), ``x`` and ``height`` (n,), ``stress``,
    ``displacement`` and ``gap`` (k, n), ``edges`` (k, most patches, 2) with NaN for none.
    """
    found: list[LoopState] = []
    absent = dict.fromkeys(wanted, 0)
    for branch, value in product(BRANCHES, wanted):
        if not at_stresses:
            found.append(_state_at(loop, method, branch, value))
            continue
        try:
            found.append(loop.at_stress(value, branch))
        except ValueError as error:
            absent[value] += 1
            if absent[value] == len(BRANCHES):
                raise InputError(f"--field-stresses: {error}") from None
    edges = np.full((len(found), max(one.state.patches for one in found), 2), np.nan)
    for row, one in zip(edges, found, strict=True):
        row[: one.state.patches] = one.edges
    fields = [one.fields(n) for one in found]
    of_states = ("branch", "penetration", "separation", "mean_stress")
    of_fields = ("stress", "displacement", "gap")
    return {
        **{name: np.array([getattr(one, name) for one in found]) for name in of_states},
        **{name: getattr(fields[0], name) for name in ("x", "height")},
        **{name: np.array([getattr(one, name) for one in fields]) for name in of_fields},
        "edges": edges,
    }


def _state_at(loop: LoopResult, method: Method, branch: Branch, wanted: float) -> LoopState:
    """Return a branch's state at a penetration: one of its own, or one followed from there."""
    separation, before = method.problem.separation(wanted), None
    states = [loop.contact_states[k] for k in loop.states(branch)]
    for k, state in enumerate(states):
        if state.patches and state.separation == separation:
            return LoopState(branch, False, wanted, state, method)
        here = method.problem.penetration(state.separation)
        if before is None and (here >= wanted if branch == "loading" else here <= wanted):
            before = states[max(k - 1, 0)]
    if before is None or (branch == "unloading" and not before.patches):
        state = method.detached(separation)
    else:
        state = method.follow(before, separation).states[-1]
    return LoopState(branch, False, wanted, state, method)
