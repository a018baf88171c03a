"""Random loops by ``zones`` against runs with 2.5 times the nodes and a tenth of the accuracy.

    python benchmarks/random_zones.py FIRST LAST

Scenes of numbers FIRST to LAST - 1, up to 2200 nodes each: H from 0.2 to 1, n0 from 1 to 4, ratio
from 5 to 30, h_rms = 1 µm, period 2 mm, E = 1 MPa, ν = 0; α of the longest wave from 0.1 to 0.8;
range from 5 nm to 1 µm; at a separation, under a stiffness or a load. Printed are loss, stated
error, both over those of the finer run, and numbers of jumps and races; at last how often the
difference exceeds the sum of both errors. What it printed is kept in ``random_zones.txt``.
"""

from __future__ import annotations

import math
import sys
import time
from typing import Any

import numpy as np

from adhesis import (
    Control,
    HalfSpace,
    LoopResult,
    Problem,
    make_method,
    run_loop,
    self_affine_profile,
)
from adhesis.solver.method import PathError
from adhesis.solver.zones.resolution import node_count

MOST_NODES, PERIOD, RMS, SOLID = 2200, 2e-3, 1e-6, HalfSpace(1e6, 0.0)


def scene(number: int) -> tuple[Problem, dict[str, Any]]:
    """Draw a problem and its turning point."""
    rng = np.random.default_rng([4711, number])
    while True:
        n0, ratio = int(rng.integers(1, 5)), int(rng.integers(5, 31))
        profile = self_affine_profile(
            rng.uniform(0.2, 1.0), h_rms=RMS, period=PERIOD, n0=n0, ratio=ratio,
            seed=int(rng.integers(10**6)),
        )  # fmt: skip
        alpha, length = 10 ** rng.uniform(-1.0, -0.1), PERIOD / n0
        gamma = (alpha * math.pi * math.sqrt(2) * RMS) ** 2 * SOLID.modulus / (2 * length)
        range_, depth = RMS * 10 ** rng.uniform(-2.3, 0.0), rng.uniform(0.2, 0.9)
        stiffness = 10 ** rng.uniform(-1, 2) * SOLID.modulus / PERIOD
        control = (Control(), Control(), Control(stiffness), Control(0.0))[rng.integers(4)]
        problem = Problem(profile, SOLID, gamma, control, adhesion_range=range_)
        if node_count(problem) <= MOST_NODES:
            break
    if control.is_load:
        return problem, {"max_stress": 0.15 * depth * SOLID.modulus * math.sqrt(profile.m2)}
    return problem, {"max_penetration": depth}


def loop_of(problem: Problem, turn: dict[str, Any], **numbers: Any) -> LoopResult:
    """Follow the loop in ten load steps."""
    return run_loop(make_method("zones", problem, **numbers), load_steps=10, **turn)


def main(first: int, last: int) -> None:
    """Print a row for each scene."""
    print("number nodes loss error over_fine error_of_fine jumps jumps_of_fine races of_error s")
    off: list[float] = []
    for number in range(first, last):
        problem, turn = scene(number)
        nodes, started = node_count(problem), time.process_time()
        finer = math.ceil(2.5 * nodes / problem.highest_harmonic)
        try:
            coarse = loop_of(problem, turn)
            seconds = time.process_time() - started
            fine = loop_of(problem, turn, nodes_per_wave=finer, accuracy=1e-4)
        except PathError as error:
            print(f"# {number}: {error}", flush=True)
            continue
        off.append(abs(coarse.loss - fine.loss) / (coarse.loss_error + fine.loss_error))
        print(
            f"{number} {nodes} {coarse.loss:.5g} {coarse.loss_error:.2g} "
            f"{coarse.loss / fine.loss:.5f} {fine.loss_error / fine.loss:.1e} "
            f"{len(coarse.jumps)} {len(fine.jumps)} {coarse.races} {off[-1]:.2f} {seconds:.1f}",
            flush=True,
        )
    found = np.array(off)
    print(f"# {len(found)} loops, {np.sum(found > 1)} off by more than both errors, ", end="")
    print(f"{np.sum(found > 2)} by more than twice; most {found.max():.2f} times")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
