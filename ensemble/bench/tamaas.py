"""Run the same loop by tamaas (an optional extra), whose adhesion has a range.

tamaas (L. Frérot et al., J. Open Source Softw. 5 (2020) 2121) minimises the energy of a periodic
half-plane with an adhesion -γ exp(-t/ρ) of the gap t. Our loss is the limit ρ → 0. The cohesive
zone at an edge is about (π/4) E*ρ²/γ long and must be resolved, so the number of nodes grows as
1/ρ², which limits ρ from below.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any

import numpy as np

from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array

_NODES_PER_ZONE = 4
_NODES_PER_WAVE = 8
_TOLERANCE = 1e-6
# Before touch the error criterion of tamaas is never met, and every iteration is used up.
_MAX_ITERATIONS = 2000
# Loading starts this many ranges above first touch, where the attraction is reduced to e⁻⁶.
_START = 6.0
_MAX_STROKES = 20


def has_tamaas() -> bool:
    """Return whether tamaas is installed."""
    return importlib.util.find_spec("tamaas") is not None


def nodes_for(problem: Problem, reach: float) -> int:
    """Return the number of nodes that resolves profile and cohesive zone; ``reach`` in m."""
    zone = np.pi / 4 * problem.half_space.modulus * reach**2 / problem.work_of_adhesion
    spacing = min(zone / _NODES_PER_ZONE, problem.profile.shortest_wavelength / _NODES_PER_WAVE)
    return int(2 ** np.ceil(np.log2(problem.profile.period / spacing)))


def tamaas_loop(
    problem: Problem, *, reach: float, max_penetration: float, load_steps: int
) -> tuple[float, int]:
    """Run one complete loop at fixed separations with adhesion of the range ``reach`` (m).

    Returns its loss in J/m² of nominal area and the number of states. RuntimeError if the contact
    has not detached after twenty loading strokes.
    """
    solver = _Continuation(importlib.import_module("tamaas"), problem, reach)
    h_max = problem.profile.h_max
    step = max_penetration / load_steps
    before = np.arange(0.0, _START * reach / h_max, step)[:0:-1]
    loading = np.concatenate([1 + before, 1 - step * np.arange(load_steps + 1)]) * h_max
    separations, stresses = [], []

    def solve(s: float) -> bool:
        stress, touching = solver.solve(s)
        separations.append(s)
        stresses.append(stress)
        return touching

    for s in loading:
        solve(float(s))
    for i in range(1, _MAX_STROKES * load_steps):
        if not solve(float(loading[-1] + i * step * h_max)):
            break
    else:
        raise RuntimeError(f"tamaas is still in contact at s = {separations[-1]} m")
    # Without contact the state at a separation is unique: above detachment the branches cancel.
    s, stress = np.array(separations), np.array(stresses)
    closed = s <= s[-1] * (1 + 1e-9)
    loss = -float(np.trapezoid(stress[closed], s[closed]))
    return loss, s.size


class _Continuation:
    """States at successive separations, each solved from the last one."""

    def __init__(self, tamaas: Any, problem: Problem, reach: float) -> None:
        tamaas.set_log_level(tamaas.LogLevel.error)
        n = nodes_for(problem, reach)
        self.height: Array = problem.profile.heights(n)
        kind = tamaas.model_type.basic_1d
        self.model = tamaas.ModelFactory.createModel(kind, [problem.profile.period], [n])
        self.model.E, self.model.nu = problem.half_space.young, problem.half_space.poisson
        gap = tamaas.PolonskyKeerRey.gap
        self.solver = tamaas.PolonskyKeerRey(self.model, self.height, _TOLERANCE, gap, gap)
        self.adhesion = tamaas.ExponentialAdhesionFunctional(self.height)
        self.adhesion.parameters = {"rho": reach, "surface_energy": problem.work_of_adhesion}
        self.solver.addFunctionalTerm(self.adhesion)
        self.solver.max_iter = _MAX_ITERATIONS

    def solve(self, separation: float) -> tuple[float, bool]:
        """Return the mean stress (Pa) at a separation (m), and whether the surfaces touch."""
        gap = self.model["gap"]
        # Starting from the last gap, scaled, keeps the contact; the last displacement loses it.
        if gap.mean() > 0:
            gap[:] *= separation / gap.mean()
        self.solver.solve(separation)
        return float(np.mean(self.model.traction)), bool((np.asarray(self.model["gap"]) <= 0).any())
