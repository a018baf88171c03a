"""One loop at the scale of the paper: cost, audit and loss of the method ``grid``.

python benchmarks/paper_loop.py --nodes-per-wave 32 --work-of-adhesion 0.04 --load-steps 40
"""

from __future__ import annotations

import argparse
import resource
from collections import Counter

import numpy as np

from adhesis import HalfSpace, Problem, run_loop, self_affine_profile
from solver.grid.method import GridMethod


def main() -> None:
    """Run one loop and print what it cost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nodes-per-wave", type=int, default=32)
    parser.add_argument("--work-of-adhesion", type=float, default=0.04)
    parser.add_argument("--load-steps", type=int, default=40)
    parser.add_argument("--accuracy", type=float, default=1e-3)
    parser.add_argument("--hurst", type=float, default=0.8)
    parser.add_argument("--ratio", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--max-penetration", type=float, default=0.9)
    options = parser.parse_args()
    profile = self_affine_profile(
        options.hurst,
        period=2e-3 * np.pi,
        n0=10,
        ratio=options.ratio,
        seed=options.seed,
        h_rms=1e-6,
    )
    method = GridMethod(
        Problem(profile, HalfSpace(1e6, 0.5), options.work_of_adhesion),
        nodes_per_wave=options.nodes_per_wave,
        accuracy=options.accuracy,
    )
    loop = run_loop(method, max_penetration=options.max_penetration, load_steps=options.load_steps)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(" ".join(f"{key} {value}" for key, value in vars(options).items()))
    print(
        f"W~ {loop.loss_dimensionless:.4f}  loss {loop.loss:.5e} J/m2  audit "
        f"{loop.audit_residual:+.1e}  {loop.seconds:.1f} s CPU  {memory:.0f} MB  "
        f"{loop.separation.size} states  pull-off at {loop.pull_off_penetration:.3f}"
    )
    print(f"jumps {dict(Counter(jump.kind for jump in loop.jumps))}")
    print(f"method {loop.method}", flush=True)


if __name__ == "__main__":
    main()
