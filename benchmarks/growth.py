"""How the cost of a loop grows with its patches and its waves, a process for each loop.

    python benchmarks/growth.py --work-of-adhesion 0.04 0.01 0.0025 0.0006 --ratio 100
    python benchmarks/growth.py --work-of-adhesion 0.0006 --periods 8.4     # about 1,000 patches

Self-affine profiles of the paper's scale (H = 0.8, m = 10 ratio, h_rms = 1 µm) on ``periods`` times
its period, with as many times more wave numbers: the same surface, and more of it. By ``sharp``,
or by ``grid`` if its ``--nodes-per-wave`` are given. Prints a table in Markdown as the loops end:
CPU seconds, patches at most, jumps, elastic solutions, CPU time of the loop for each of them, audit
residual, estimated error of the loss, and the most memory of the process. The last column is the
exponent of the CPU time from one row to the next: in the wave numbers where the ratio differs, else
in the patches.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
from dataclasses import asdict
from time import process_time

import numpy as np

from adhesis import HalfSpace, Problem, run_loop, self_affine_profile
from adhesis.solver.registry import MethodName, make_method
from adhesis.solver.sharp.method import SharpMethod

_COLUMNS = (
    "γ (J/m²)", "m to", "periods", "CPU s", "patches", "jumps", "solutions", "ms each", "W~",
    "audit", "reported error", "MB", "exponent",
)  # fmt: skip


def measure(gamma: float, ratio: float, periods: float, given: argparse.Namespace) -> list[str]:
    """One loop: its row without the exponent."""
    count = round(10 * periods)
    profile = self_affine_profile(
        0.8, period=2e-3 * np.pi * count / 10, n0=count, ratio=ratio, seed=given.seed, h_rms=1e-6
    )
    warm = self_affine_profile(0.8, period=2e-3 * np.pi, n0=10, ratio=10, seed=1, h_rms=1e-6)
    # load the code
    run_loop(
        SharpMethod(Problem(warm, HalfSpace(1e6, 0.5), 0.004)), max_penetration=0.5, load_steps=5
    )
    nodes = given.nodes_per_wave
    problem = Problem(profile, HalfSpace(1e6, 0.5), gamma)
    name: MethodName = "sharp" if nodes is None else "grid"
    method = make_method(name, problem, nodes_per_wave=nodes)
    started = process_time()
    loop = run_loop(method, max_penetration=given.max_penetration, load_steps=given.load_steps)
    seconds = process_time() - started
    counted = asdict(loop.method)
    solutions = counted["fields" if nodes is None else "solves"]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
    return [
        f"{gamma:g}", f"{round(ratio * count)}", f"{periods:g}", f"{seconds:.3g}",
        f"{loop.patches.max()}", f"{len(loop.jumps)}", f"{solutions}",
        f"{1e3 * seconds / solutions:.3f}", f"{loop.loss_dimensionless:.6g}",
        f"{loop.audit_residual:+.0e}",
        f"{loop.loss_error / abs(loop.loss):.0e}", f"{memory:.0f}",
    ]  # fmt: skip


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--work-of-adhesion", type=float, nargs="+", default=[0.04, 0.01, 0.0025])
    parser.add_argument("--ratio", type=float, nargs="+", default=[100])
    parser.add_argument("--periods", type=float, nargs="+", default=[1.0])
    parser.add_argument("--max-penetration", type=float, default=0.9)
    parser.add_argument("--load-steps", type=int, default=40)
    parser.add_argument("--nodes-per-wave", type=int, help="follow the loops with grid")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--alone", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    scenes = [
        (gamma, ratio, periods)
        for ratio in given.ratio
        for periods in given.periods
        for gamma in given.work_of_adhesion
    ]
    if given.alone:
        print(" | ".join(measure(*scenes[0], given)))
        return
    print("| " + " | ".join(_COLUMNS) + " |")
    print("|" + " ---: |" * len(_COLUMNS), flush=True)
    before: tuple[float, float, float] | None = None
    for gamma, ratio, periods in scenes:
        command = [
            sys.executable, __file__, "--alone", "--work-of-adhesion", str(gamma), "--ratio",
            str(ratio), "--periods", str(periods), "--seed", str(given.seed),
            "--max-penetration", str(given.max_penetration),
            "--load-steps", str(given.load_steps),
        ]  # fmt: skip
        if given.nodes_per_wave is not None:
            command += ["--nodes-per-wave", str(given.nodes_per_wave)]
        row = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.strip()
        cells = row.split(" | ")
        now = float(cells[3]), float(cells[1]), float(cells[4])
        exponent = ""
        if before:
            time, waves, patches = np.log(np.divide(now, before))
            if waves or patches:
                exponent = f"{time / (waves or patches):.2f}"
        before = now
        print(f"| {row} | {exponent} |", flush=True)


if __name__ == "__main__":
    main()
