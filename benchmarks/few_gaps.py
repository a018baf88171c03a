"""What a complete loop of few patches costs: fields of jumps and of branches, CPU time, its loss.

    python benchmarks/few_gaps.py --work-of-adhesion 0.07 0.04 --seeds 1 2 3

The paper's roughness (m = 10 ... 1000, h_rms = 1 µm), Δ~max = 0.9, 40 load steps. Compare a change
of the descent by losses and numbers of jumps, not by its fields alone: a step that leaps over a
pinned minimum is cheap.
"""

from __future__ import annotations

import argparse
from time import process_time

import numpy as np

from adhesis.solver.loading.loop import run_loop
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import self_affine_profile
from adhesis.solver.sharp.method import SharpMethod


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--work-of-adhesion", type=float, nargs="+", default=[0.07, 0.04, 0.01])
    parser.add_argument("--hurst", type=float, default=0.8)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--accuracy", type=float, default=1e-3)
    given = parser.parse_args()
    print(
        "     γ  seed      loss   error    audit  jumps  fields  descent  Newton  energies    CPU s"
    )
    for gamma in given.work_of_adhesion:
        for seed in given.seeds:
            profile = self_affine_profile(
                given.hurst, period=2e-3 * np.pi, n0=10, ratio=100, h_rms=1e-6, seed=seed
            )
            problem = Problem(profile, HalfSpace(1e6, 0.5), gamma)
            started = process_time()
            method = SharpMethod(problem, accuracy=given.accuracy)
            loop = run_loop(method, max_penetration=0.9, load_steps=40)
            spent = process_time() - started
            reported = method.report()
            print(
                f"{gamma:6g} {seed:5d} {loop.loss_dimensionless:9.5f} "
                f"{loop.loss_error / loop.loss:7.1e} {loop.audit_residual:8.1e} "
                f"{len(loop.jumps):6d} {reported.fields:7d} {reported.descent_steps:8d} "
                f"{reported.newton_steps:7d} {reported.energies:9d} {spent:8.2f}"
            )


if __name__ == "__main__":
    main()
