"""Loss by tamaas, whose adhesion has a range, beside that of zero range: CPU time and error.

    pip install tamaas
    OMP_NUM_THREADS=1 python benchmarks/tamaas_range.py            # minutes
    OMP_NUM_THREADS=1 python benchmarks/tamaas_range.py one-wave   # seconds

Scenes are those of ``adhesis bench``; errors refer to the closed form, or to `sharp` at 1e-5.

tamaas (L. Frérot et al., J. Open Source Softw. 5 (2020) 2121) minimises the energy of a periodic
half-plane with an adhesion -γ exp(-t/ρ) of the gap t. Our loss is the limit ρ → 0. The cohesive
zone at an edge is about (π/4) E*ρ²/γ long and must be resolved, so the number of nodes grows as
1/ρ², which limits ρ from below.
"""

from __future__ import annotations

import argparse
from time import process_time

import numpy as np
import tamaas

from adhesis import Problem, make_method, run_loop
from adhesis.ensemble.bench.scenes import ONE_WAVE, PAPER, ROUGH, SMALL_ROUGH, TWO_WAVES
from adhesis.solver.model.profile import Array

# Ranges in units of h_max, as small as feasible, and by how much its load steps, which do not
# locate jumps, are finer than those of the scene.
SCENES = {
    ONE_WAVE: ((0.05, 0.03), 5),
    TWO_WAVES: ((0.5,), 1),
    SMALL_ROUGH: ((0.5, 0.3), 1),
    ROUGH: ((0.3, 0.2), 1),
    PAPER: ((0.2, 0.1), 1),
}
_NODES_PER_ZONE = 4
_NODES_PER_WAVE = 8
_TOLERANCE = 1e-6
# Before touch the error criterion of tamaas is never met, and every iteration is used up.
_MAX_ITERATIONS = 2000
# Loading starts this many ranges above first touch, where the attraction is reduced to e⁻⁶.
_START = 6.0
_MAX_STROKES = 20


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
    solver = _Continuation(problem, reach)
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

    def __init__(self, problem: Problem, reach: float) -> None:
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


def main() -> None:
    """Measure and print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    names = [scene.name for scene in SCENES]
    parser.add_argument("scenes", nargs="*", choices=[*names, []], default=names)
    wanted = parser.parse_args().scenes
    print("| scene | range (h_max) | CPU s | W~ | error | states |")
    print("|---|---:|---:|---:|---:|---:|", flush=True)
    for scene, (ranges, finer) in SCENES.items():
        if scene.name not in wanted:
            continue
        problem, turn = scene.problem(), scene.max_penetration
        reference = scene.exact_loss
        if reference is None:
            method = make_method("sharp", problem, accuracy=1e-5)
            reference = run_loop(method, max_penetration=turn, load_steps=scene.load_steps).loss
        for reach in ranges:
            started = process_time()
            loss, states = tamaas_loop(
                problem,
                reach=reach * problem.profile.h_max,
                max_penetration=turn,
                load_steps=finer * scene.load_steps,
            )
            print(
                f"| {scene.title} | {reach:g} | {process_time() - started:.3g} | "
                f"{loss / problem.loss_scale:.6g} | {loss / reference - 1:+.2g} | {states} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
