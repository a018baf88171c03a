"""Compare both methods on loops in which many patches open from inside.

    python benchmarks/openings.py [--first 0] [--scenes 5] [--nodes-per-wave 42]

Profiles of 24 to 36 waves, h_rms = 1 µm, E = 1 MPa, ν = 0.5, Δ/h_max = 0.98 in 20 load steps; the
strength is that of a Griffith crack 0.03 shortest waves long.
"""

from __future__ import annotations

import argparse
import math
from typing import NamedTuple

from adhesis import (
    HalfSpace,
    LoopResult,
    Method,
    Problem,
    make_method,
    run_loop,
    self_affine_profile,
)
from adhesis.solver.grid.method import GridMethod

CRACK = 0.03  # Griffith's length, of the shortest wave


class Scene(NamedTuple):
    """Wave numbers over q0 from n0 to n0·ratio; γ in J/m²."""

    n0: int
    ratio: int
    seed: int
    gamma: float

    def problem(self) -> Problem:
        """Return the problem with its strength."""
        profile = self_affine_profile(
            0.8, period=2e-3, n0=self.n0, ratio=self.ratio, seed=self.seed, h_rms=1e-6
        )
        solid = HalfSpace(1e6, 0.5)
        length = CRACK * profile.shortest_wavelength
        strength = math.sqrt(4 * solid.modulus * self.gamma / (math.pi * length))
        return Problem(profile, solid, self.gamma, strength=strength)


SCENES = (
    Scene(12, 2, 0, 1e-3),
    Scene(12, 2, 1, 1e-3),
    Scene(16, 2, 0, 1e-3),
    Scene(16, 2, 0, 3e-4),
    Scene(12, 3, 0, 1e-3),
)


def main() -> None:
    """Run the loops and print a row for each scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=len(SCENES))
    parser.add_argument("--nodes-per-wave", type=int, help="of grid; its own choice by default")
    given = parser.parse_args()
    print("| waves | seed | γ (J/m²) | openings | loss, sharp | loss, grid | difference/errors |")
    print("|---|---|---|---|---|---|---|")
    for scene in SCENES[given.first : given.first + given.scenes]:
        problem = scene.problem()
        sharp = _loop(make_method("sharp", problem))
        grid = _loop(GridMethod(problem, nodes_per_wave=given.nodes_per_wave))
        share = abs(sharp.loss - grid.loss) / (sharp.loss_error + grid.loss_error)
        print(
            f"| {scene.n0} to {scene.n0 * scene.ratio} | {scene.seed} | {scene.gamma:g} | "
            f"{sharp.openings}, {grid.openings} | {sharp.loss:.4e} ± {sharp.loss_error:.0e} | "
            f"{grid.loss:.4e} ± {grid.loss_error:.0e} | {share:.2f} |",
            flush=True,
        )


def _loop(method: Method) -> LoopResult:
    return run_loop(method, max_penetration=0.98, load_steps=20)


if __name__ == "__main__":
    main()
