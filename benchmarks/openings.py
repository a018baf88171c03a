"""Compare both methods on loops in which many patches open from inside.

    python benchmarks/openings.py [--first 0] [--scenes 5] [--nodes-per-wave 64 256]

Profiles of 24 to 36 waves, h_rms = 1 µm, E = 1 MPa, ν = 0.5, Δ/h_max = 0.98 in 20 load steps; the
strength is that of a Griffith crack a tenth of a shortest wave long. ``grid`` runs with several
numbers of nodes per shortest wave, so that its loss is seen to converge.
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

CRACK = 0.1  # Griffith's length, of the shortest wave


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
    Scene(12, 2, 0, 3e-3),
    Scene(12, 2, 1, 3e-3),
    Scene(16, 2, 0, 3e-3),
    Scene(16, 2, 1, 2e-3),
    Scene(12, 3, 0, 3e-3),
)


def main() -> None:
    """Run the loops and print a row for each scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=len(SCENES))
    parser.add_argument("--nodes-per-wave", type=int, nargs="+", default=[64, 256], help="of grid")
    given = parser.parse_args()
    grids = "".join(f" grid, {nodes} nodes |" for nodes in given.nodes_per_wave)
    print(f"| waves | seed | γ (J/m²) | openings | loss, sharp |{grids} difference/errors |")
    print("|" + "---|" * (6 + len(given.nodes_per_wave)))
    for scene in SCENES[given.first : given.first + given.scenes]:
        problem = scene.problem()
        loops = [_loop(make_method("sharp", problem))]
        loops += [_loop(GridMethod(problem, nodes_per_wave=n)) for n in given.nodes_per_wave]
        sharp, finest = loops[0], loops[-1]
        share = abs(sharp.loss - finest.loss) / (sharp.loss_error + finest.loss_error)
        losses = " | ".join(f"{loop.loss:.4e} ± {loop.loss_error:.0e}" for loop in loops)
        print(
            f"| {scene.n0} to {scene.n0 * scene.ratio} | {scene.seed} | {scene.gamma:g} | "
            f"{', '.join(str(loop.openings) for loop in loops)} | {losses} | {share:.2f} |",
            flush=True,
        )


def _loop(method: Method) -> LoopResult:
    return run_loop(method, max_penetration=0.98, load_steps=20)


if __name__ == "__main__":
    main()
