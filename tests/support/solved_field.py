"""Fields of given gaps."""

from __future__ import annotations

import numpy as np

from adhesis.solver._kernels import FieldModel, LoadingDevice, solve_field
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.field.gap_field import GapField
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.system.edge_problem import FIXED_SEPARATION


def solved_field(
    source: StressSource,
    gaps: Array,
    prescribed: float,
    tolerance: float,
    device: LoadingDevice = FIXED_SEPARATION,
) -> GapField:
    """Solve the field of these gaps to a relative accuracy."""
    model = FieldModel(device, float(-np.log(tolerance)), source.panels)
    return GapField(
        source, gaps, prescribed, tolerance, device, lambda: solve_field(gaps, prescribed, model)
    )
