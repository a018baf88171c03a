"""Fields of given gaps."""

from __future__ import annotations

import numpy as np
from adhesis.solver.sharp.field.hierarchical_solver import solve_many
from adhesis.solver.sharp.field.solution import (
    FIXED_SEPARATION,
    FieldModel,
    LoadingDevice,
)
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, choose_orders

from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.gap.full_contact_stress import StressSource


def solved_field(
    source: StressSource,
    gaps: Array,
    prescribed: float,
    tolerance: float,
    device: LoadingDevice = FIXED_SEPARATION,
) -> GapField:
    """Solve the field of these gaps to a relative accuracy."""
    model = FieldModel(device, float(-np.log(tolerance)), GAUSS_RULES, source.panels)
    orders = choose_orders(map_gaps(gaps), model.digits, GAUSS_RULES.counts)
    return GapField(
        source, gaps, prescribed, tolerance, device,
        lambda: solve_many(gaps, prescribed, orders, 2, model)[0],
    )  # fmt: skip
