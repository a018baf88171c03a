"""Call the kernels in C++ with the arguments and results of the functions in Python.

Fields, linear responses, equilibria and descents: the functions of ``hierarchical_solver``,
``separate_gaps``, ``response_setup``, ``renewal``, ``hierarchical_newton``, ``condensed`` and
``implicit_flow`` that Python calls.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesis.solver import _kernels  # type: ignore[attr-defined]
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.equilibrium.griffith import EdgeLaw
from adhesis.solver.sharp.field.solution import (
    Equations,
    FieldModel,
    LoadingDevice,
    MeanResponse,
    Nodes,
    Solution,
)
from adhesis.solver.sharp.gap.full_contact_stress import Panels
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, Integers

_RULES = _kernels.make_rules(
    GAUSS_RULES.counts, GAUSS_RULES.eta, GAUSS_RULES.weights, GAUSS_RULES.end_values,
    GAUSS_RULES.crack, GAUSS_RULES.modes,
)  # fmt: skip
_NO_MATRIX = np.empty((0, 0))
_panels: dict[int, tuple[Panels, Any]] = {}
_models: dict[tuple[int, LoadingDevice, float], Any] = {}


def model_of(model: FieldModel) -> Any:
    """Return a model for the kernels."""
    panels = model.panels
    key = (id(panels.stress), model.device, model.digits)
    if key not in _models:
        if id(panels.stress) not in _panels:
            made = _kernels.make_panels(
                panels.width, panels.finest_count, panels.x, panels.w, panels.stress, panels.slope,
                panels.tilt, panels.half_plane, panels.weights, panels.level_start, panels.end_x,
                panels.end_w, panels.short.shape[1],
            )  # fmt: skip
            _panels[id(panels.stress)] = panels, made
        of_profile = _panels[id(panels.stress)][1]
        _models[key] = _kernels.Model(*model.device, model.digits, _RULES, of_profile)
    return _models[key]


@lru_cache
def law_of(law: EdgeLaw) -> Any:
    """Return an edge law for the kernels."""
    return _kernels.EdgeLaw(*law[:8])


def _solution(field: Any, weight: float, *, solved: bool) -> Solution:
    orders, theta = field.orders, field.theta
    both = _NO_MATRIX
    if solved:
        both = np.zeros((len(theta), 2))
        both[:, 1] = field.unit_solved
    no_array = np.empty(0)
    nodes = Nodes(
        field.table, orders, field.offset, theta, field.weight, no_array, no_array, field.slope
    )
    return Solution(
        nodes=nodes,
        equations=Equations(_NO_MATRIX, field.load.reshape(-1, 1), np.empty((0, 0, 0))),
        solved=both,
        mean=MeanResponse(weight, field.unit_mean, field.resistance),
        separation=field.separation,
        pressure=field.pressure,
        scaled_opening=field.scaled_opening,
        opening=field.opening,
    )


def solve_many(
    gaps: Array, prescribed: float, orders: Integers, fields: int, model: FieldModel
) -> tuple[Solution, None]:
    """Solve the field of many gaps."""
    field = _kernels.solve_field(gaps, prescribed, orders, model_of(model))
    return _solution(field, model.device.separation_weight, solved=True), None


def solve_separately(
    edges: Array, table: Array, orders: Integers, potential: Array, pressure: float,
    prescribed: float, model: FieldModel,
) -> Solution:  # fmt: skip
    """Solve every gap by itself in the potential of the others."""
    field = _kernels.solve_separately(
        edges, table, orders, potential, pressure, prescribed, model_of(model)
    )
    return _solution(field, model.device.separation_weight, solved=False)


class _NodesOf:
    def __init__(self, response: Any) -> None:
        self._response = response

    @property
    def table(self) -> Array:
        table: Array = self._response.table
        return table

    @property
    def orders(self) -> Integers:
        orders: Integers = self._response.orders
        return orders


class Response:
    """A linear response of the kernels."""

    def __init__(self, kernel: Any) -> None:
        self.kernel, self.nodes = kernel, _NodesOf(kernel)

    @property
    def opening(self) -> Array:
        """C of every edge in its reference."""
        opening: Array = self.kernel.opening
        return opening


def set_up_response(
    gaps: Array, prescribed: float, orders: Integers, law: EdgeLaw, model: FieldModel
) -> tuple[Response, bool]:
    """Solve the field of these gaps, and linearise about it."""
    made = _kernels.set_up_response(gaps, prescribed, orders, law_of(law), model_of(model))
    return Response(made), made is not None


def update_response(
    known: Response, gaps: Array, prescribed: float, least: Integers, law: EdgeLaw,
    model: FieldModel,
) -> tuple[Response, bool]:  # fmt: skip
    """Set up a response of gaps of which most are those of another."""
    made = _kernels.update_response(
        known.kernel, gaps, prescribed, least, law_of(law), model_of(model)
    )
    return Response(made), made is not None


def count_unknown(known: Response, gaps: Array, law: EdgeLaw, model: FieldModel) -> int:
    """Count the gaps that :func:`update_response` would not take over from a response."""
    return int(_kernels.count_unknown(known.kernel, gaps, law_of(law), model_of(model)))


def settle_response(
    response: Response, gaps: Array, prescribed: float, law: EdgeLaw, model: FieldModel
) -> bool:
    """Renew the response for a known equilibrium."""
    return bool(
        _kernels.settle_response(response.kernel, gaps, prescribed, law_of(law), model_of(model))
    )


def tangent_between(
    response: Response, gaps: Array, edges: Integers, prescribed: float, law: EdgeLaw,
    model: FieldModel,
) -> Array:  # fmt: skip
    """Compute ∂(C_e - C_c)/∂n_f between some edges of these gaps, all others following."""
    tangent: Array = _kernels.tangent_between(
        response.kernel, gaps, edges, prescribed, law_of(law), model_of(model)
    )
    return tangent


def equilibrium_many(
    response: Response, gaps: Array, prescribed: float, reach: float, strict: bool, law: EdgeLaw,
    model: FieldModel,
) -> Any:  # fmt: skip
    """Find the equilibrium next to ``gaps``."""
    return _kernels.find_equilibrium(
        response.kernel, gaps, prescribed, reach, strict, law_of(law), model_of(model)
    )


def descend(
    response: Response, gaps: Array, prescribed: float, most: int, equal_speeds: bool,
    running: Any, law: EdgeLaw, model: FieldModel,
) -> Any:  # fmt: skip
    """Descend in energy until an event."""
    return _kernels.descend(
        response.kernel, gaps, prescribed, most, equal_speeds, running.edges, running.start,
        running.reach, law_of(law), model_of(model),
    )  # fmt: skip


def _model_with(panels: Panels) -> Any:
    return model_of(FieldModel(LoadingDevice(1.0, 0.0), 0.0, GAUSS_RULES, panels))


def _field_of(nodes: Nodes, f: Array, model: Any, load: Array = _NO_MATRIX) -> Any:
    return _kernels.make_field(
        nodes.table, nodes.orders, nodes.theta, nodes.slope, np.ascontiguousarray(f), load, model
    )


_lengths = lru_cache(lambda lengths: _kernels.SearchLengths(*lengths))
_NONE = _kernels.Searched()


def _known(searched: Any) -> Any:
    return searched if isinstance(searched, _kernels.Searched) else _NONE


def search(
    gaps: Array, nodes: Nodes, f: Array, rules: Any, panels: Panels, lengths: Any, searched: Any
) -> tuple[float, int, tuple[Array, Array, Array], Any]:
    """Find the least clearance of a field, searching only gaps that may have closed."""
    model = _model_with(panels)
    found: tuple[float, int, tuple[Array, Array, Array], Any] = _kernels.search(
        _field_of(nodes, f, model), _known(searched), _lengths(lengths), model
    )
    return found


def clearance_left(
    nodes: Nodes, f: Array, panels: Panels, lengths: Any, searched: Any
) -> Array:
    """Compute a lower bound of the clearance in each gap."""
    model = _model_with(panels)
    left: Array = _kernels.clearance_left(
        _field_of(nodes, f, model), _known(searched), _lengths(lengths), model
    )
    return left


def least_clearances(
    indices: Integers, nodes: Nodes, f: Array, panels: Panels, lengths: Any
) -> Array:
    """Find the least clearance of some gaps."""
    model = _model_with(panels)
    given = _field_of(nodes, f, model), indices, _lengths(lengths), model
    least: Array = _kernels.search_gaps(*given)[1]
    return least[indices]


def open_gap(
    nodes: Nodes, k: int, f: Array, count: int, panels: Panels
) -> tuple[Array, Array, Array, Array]:
    """Evaluate θ, falling, dθ/dt, T and b_n of gap k at so many nodes."""
    model = _model_with(panels)
    fine: tuple[Array, Array, Array, Array] = _kernels.open_gap(
        _field_of(nodes, f, model), k, count, model
    )
    return fine


def work_of_gaps(nodes: Nodes, load: Array, f: Array, top: int, panels: Panels) -> float:
    """Integrate S_full T dθ over the gaps."""
    model = _model_with(panels)
    return float(_kernels.work_of_gaps(_field_of(nodes, f, model, load), top, model))


def edge_openings(f: Array, nodes: Nodes, rules: Any) -> Array:
    """Evaluate sqrt(2 dη/dθ) f(±1) at every gap end, shape (2L, 1)."""
    model = next(iter(_models.values()))
    opening: Array = _kernels.edge_openings(_field_of(nodes, f, model), f, model)
    return opening.reshape(-1, 1)


def map_gaps(gaps: Array) -> Array:
    """Make the table of gaps."""
    table: Array = _kernels.map_gaps(np.ascontiguousarray(gaps))
    return table


def choose_orders(table: Array, digits: float, counts: Integers) -> Integers:
    """Choose the order of each gap."""
    orders: Integers = _kernels.choose_orders(table, digits, _RULES)
    return orders


def shortest_length(gaps: Array) -> float:
    """Find the length of the shortest gap or patch."""
    return float(_kernels.shortest_length(np.ascontiguousarray(gaps)))


_length_rules: dict[int, tuple[Array, Any]] = {}


def contact_between(
    gaps: Array, before: Array, panels: Panels, nodes: Array, weights: Array
) -> tuple[Array, float]:
    """Return the patches between gaps, and the length of the profile over them."""
    _model_with(panels)
    if id(before) not in _length_rules:
        _length_rules[id(before)] = before, _kernels.LengthRule(nodes, weights, before)
    rule = _length_rules[id(before)][1]
    kernel = _panels[id(panels.stress)][1]
    left = np.concatenate([[gaps[-1, 1] - 2 * np.pi], gaps[:-1, 1]])
    patches = np.stack([left, gaps[:, 0]], axis=1)
    patches -= np.floor(patches[:, :1] / (2 * np.pi)) * 2 * np.pi
    first = int(np.argmin(patches[:, 0]))
    length = float(_kernels.contact_length(gaps, kernel, rule))
    return np.concatenate([patches[first:], patches[:first]]), length
