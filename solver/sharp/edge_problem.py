"""The edges of one problem: material law, tolerances, counters; in units of 1/q0."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adhesis.solver._kernels import (
    Adhesion,
    EdgeLaw,
    FieldModel,
    LoadingDevice,
    ProfileAdhesion,
)
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.tolerances import (
    BY_FIELD,
    DESCENT_HANDS_OVER,
    FIELD_ERROR,
    LONGEST_STEP,
    NEWTON_TOLERANCE,
    SMALLEST_LENGTH,
    SMALLEST_OF_SEED,
)

FIXED_SEPARATION = LoadingDevice(1.0, 0.0)


@dataclass
class Counters:
    """Numbers of field solutions (also by the linear response), energies, fine openings, steps."""

    fields: int = 0
    energies: int = 0
    openings: int = 0
    newton_steps: int = 0
    descent_steps: int = 0


class EdgeProblem:
    """Material law (by default that of one work of adhesion), tolerances and counters of a problem.

    Attributes
    ----------
    critical : float
        4 sqrt(q0 γ/(π E*)): the critical opening on a flat piece where γ(x) = γ.
    tolerance : float
        Relative accuracy of the field.
    wave : float
        λ_min in θ.
    newton_tolerance, field_error : float
        Correction that ends Newton's iteration; displacement of an equilibrium that the error of
        the field can cause.
    smallest : float
        Narrower patches and gaps are removed.
    surface : float
        Γ = 2γ q0/E* where adhesion is weakest.
    """

    def __init__(
        self,
        source: StressSource,
        critical: float,
        tolerance: float,
        device: LoadingDevice = FIXED_SEPARATION,
        adhesion: Adhesion | None = None,
    ) -> None:
        self.source, self.critical, self.tolerance = source, critical, tolerance
        self.adhesion = adhesion or ProfileAdhesion(source.panels)
        self.wave = 2 * np.pi / source.top
        self.newton_tolerance = min(NEWTON_TOLERANCE, BY_FIELD * tolerance) * self.wave
        self.field_error = max(self.newton_tolerance, FIELD_ERROR * tolerance * self.wave)
        self.longest_step = LONGEST_STEP * self.wave
        # far below the width at which a patch on the sharpest crest first comes to rest,
        # (16 Γ/(π κ²))^(1/3) with Γ = π C_c²/8, where adhesion is weakest
        weakest = critical**2 * self.adhesion.least
        self.surface = np.pi * weakest / 8  # Γ
        seed = (2 * weakest / source.sharpest**2) ** (1 / 3)
        self.smallest = SMALLEST_LENGTH * self.wave
        if critical > 0:
            self.smallest = min(self.smallest, SMALLEST_OF_SEED * seed)
        self.law = EdgeLaw(
            adhesion=self.adhesion,
            critical=float(critical),
            newton_tolerance=self.newton_tolerance,
            field_error=self.field_error,
            rest_step=DESCENT_HANDS_OVER * self.wave,
            longest_step=self.longest_step,
            smallest=float(self.smallest),
            rough_rate=float(max(critical, np.sqrt(source.m2 * self.wave)) / self.wave),
            force_error=float(tolerance * critical**2),
        )
        self.model = FieldModel(
            device=device,
            digits=float(-np.log(tolerance)),
            panels=source.panels,
        )
        self.count = Counters()

    @property
    def pins(self) -> bool:
        """Whether edges are pinned, as works of adhesion differ."""
        return self.adhesion.pins

    def law_at(self, memory: Array) -> EdgeLaw:
        """Return the law of edges that were at ``memory`` in the state before."""
        if not self.pins:
            return self.law
        law = EdgeLaw(self.law)
        law.memory = memory
        return law

    @property
    def largest_opening(self) -> float:
        """Largest critical opening of an edge, on a flat piece."""
        return float(self.critical * np.sqrt(self.adhesion.largest))

    @property
    def is_fixed(self) -> bool:
        """Whether the separation is prescribed."""
        return self.model.device.compliance == 0

    @property
    def is_load(self) -> bool:
        """Whether the mean stress is prescribed."""
        return self.model.device.separation_weight == 0
