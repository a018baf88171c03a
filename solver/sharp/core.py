"""Choose the kernels: in C++, or those that numba compiles if ``ADHESIS_KERNELS=numba``."""

from __future__ import annotations

import os
from typing import Any

from adhesis.solver.sharp import native as _native
from adhesis.solver.sharp.descent import implicit_flow
from adhesis.solver.sharp.equilibrium import (
    condensed,
    griffith,
    hierarchical_newton,
    renewal,
    response_setup,
)
from adhesis.solver.sharp.field import hierarchical_solver, separate_gaps, solution
from adhesis.solver.sharp.gap import conformal_map, quadrature

_numba = os.environ.get("ADHESIS_KERNELS") == "numba"


is_native = not _numba


def _choose(module: Any, name: str) -> Any:
    return getattr(module if _numba else _native, name)


solve_many = _choose(hierarchical_solver, "solve_many")
solve_separately = _choose(separate_gaps, "solve_separately")
set_up_response = _choose(response_setup, "set_up_response")
update_response = _choose(response_setup, "update_response")
count_unknown = _choose(response_setup, "count_unknown")
settle_response = _choose(renewal, "settle_response")
tangent_between = _choose(condensed, "tangent_between")
equilibrium_many = _choose(hierarchical_newton, "equilibrium_many")
descend = _choose(implicit_flow, "descend")
map_gaps = _choose(conformal_map, "map_gaps")
choose_orders = _choose(quadrature, "choose_orders")
shortest_length = _choose(griffith, "shortest_length")
edge_openings = _choose(solution, "edge_openings")
