"""What loops gain and lose by windows and the tree of gaps: against the same by dense matrices.

    python benchmarks/windows.py --gamma 0.01 0.005 0.0025 --many 8 30 30

The paper's roughness; CPU times. Jumps of one loop that the other does not have are listed with the
largest of their drops; they are the same if they lie within 5e-3 h_max of each other and are of one
kind.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from time import process_time

import numpy as np

from adhesis.solver.loading.loop import run_loop
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.jump import Jump
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import self_affine_profile
from adhesis.solver.precompile import warm
from adhesis.solver.runtime.malloc import keep_freed
from adhesis.solver.sharp.method import SharpMethod

_SAME = 5e-3  # separations of a jump in both loops, in h_max


def _loop(problem: Problem, many: int, load_steps: int) -> tuple[float, LoopResult]:
    method = SharpMethod(problem)
    method.edges.many = many
    started = process_time()
    loop = run_loop(method, max_penetration=0.9, load_steps=load_steps)
    return process_time() - started, loop


def _only_in(jumps: Iterable[Jump], others: Iterable[Jump], near: float) -> list[float]:
    """Drops of those jumps that are not among the others."""
    left = list(others)
    only = []
    for jump in jumps:
        alike = [
            other
            for other in left
            if (other.branch, other.kind) == (jump.branch, jump.kind)
            and abs(other.separation - jump.separation) < near
        ]
        if alike:
            left.remove(min(alike, key=lambda other: abs(other.separation - jump.separation)))
        else:
            only.append(jump.energy_drop)
    return only


def _told(drops: list[float]) -> str:
    return f"{len(drops)} (up to {max(drops):.1e} J/m²)" if drops else "none"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--gamma", type=float, nargs="+", default=[0.01, 0.005, 0.0025])
    parser.add_argument("--many", type=int, nargs="+", default=[8, 30, 30])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--load-steps", type=int, default=40)
    given = parser.parse_args()
    keep_freed()  # as in a loop
    warm(["sharp"])
    profile = self_affine_profile(
        0.8, period=2e-3 * np.pi, n0=10, ratio=100, h_rms=1e-6, seed=given.seed
    )
    for gamma, many in zip(given.gamma, given.many, strict=True):
        problem = Problem(profile, HalfSpace(young=1e6, poisson=0.5), gamma)
        time, loop = _loop(problem, many, given.load_steps)
        dense_time, dense = _loop(problem, 1_000_000, given.load_steps)
        near = _SAME * profile.h_max
        print(
            f"γ {gamma:g}, {loop.patches.max()} patches: windows from {many} gaps {time:.2f} s, "
            f"dense {dense_time:.2f} s; jumps {len(loop.jumps)} and {len(dense.jumps)}, in windows "
            f"alone {_told(_only_in(loop.jumps, dense.jumps, near))}, by dense matrices alone "
            f"{_told(_only_in(dense.jumps, loop.jumps, near))}; losses apart by "
            f"{abs(loop.loss / dense.loss - 1):.1e}",
            flush=True,
        )


if __name__ == "__main__":
    main()
