"""How often the length of the descent's steps decides where a jump ends.

    python benchmarks/descent_steps.py --seeds 30

Small rough profiles (two Hurst exponents, three works of adhesion, one seed after the other) are
followed with the steps as they are and with steps a quarter as long; printed is each loop whose
losses differ by more than 3e-4, how many there are, and in how many of them the energy at stake in
flagged jumps is less than the difference. About 2.5 minutes of CPU time for 30 seeds.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from adhesis.solver.loading.loop import run_loop
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import self_affine_profile
from adhesis.solver.sharp.method import SharpMethod

PROFILES = ((0.8, 2, 16), (0.5, 3, 20))  # H, n0, q_max/q_min
WORKS_OF_ADHESION = (0.01, 0.03, 0.1)
DIFFERENT = 3e-4


def loop_of(problem: Problem, share: float) -> LoopResult:
    """Follow a loop with steps ``share`` times as long."""
    method = SharpMethod(problem, accuracy=1e-3)
    method.edges.law.longest_step *= share
    return run_loop(method, max_penetration=0.9, load_steps=20)


def main() -> int:
    """Compare, and print."""
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0] if __doc__ else None, allow_abbrev=False
    )
    parser.add_argument("--seeds", type=int, default=30)
    seeds = parser.parse_args().seeds
    different = unflagged = loops = 0
    for seed in range(1, seeds + 1):
        for hurst, n0, ratio in PROFILES:
            profile = self_affine_profile(
                hurst, period=1e-3, n0=n0, ratio=ratio, seed=seed, h_rms=1e-6
            )
            for gamma in WORKS_OF_ADHESION:
                problem = Problem(profile, HalfSpace(young=1e6, poisson=0.5), gamma)
                usual, short = loop_of(problem, 1.0), loop_of(problem, 0.25)
                loops += 1
                apart = usual.loss / short.loss - 1
                if abs(apart) > DIFFERENT:
                    different += 1
                    unflagged += usual.energy_at_stake < abs(usual.loss - short.loss)
                    print(
                        f"H = {hurst}, γ = {gamma}, seed {seed}: {apart:+.1e}, races "
                        f"{usual.races} and {short.races}",
                        flush=True,
                    )
    print(f"{different} of {loops} losses differ by more than {DIFFERENT}, {unflagged} unflagged")
    return 0


if __name__ == "__main__":
    sys.exit(main())
