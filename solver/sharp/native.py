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
    response: Response, edges: Integers, prescribed: float, law: EdgeLaw, device: LoadingDevice
) -> Array:
    """Compute ∂(C_e - C_c)/∂n_f between some edges, all others following."""
    tangent: Array = _kernels.tangent_between(
        response.kernel, edges, prescribed, law_of(law), *device
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
    runs: NDArray[np.bool_], reach: float, law: EdgeLaw, model: FieldModel,
) -> Any:  # fmt: skip
    """Descend in energy until an event."""
    return _kernels.descend(
        response.kernel, gaps, prescribed, most, equal_speeds, runs, reach, law_of(law),
        model_of(model),
    )  # fmt: skip
