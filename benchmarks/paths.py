"""The energy audit of every kind of path at the paper's scale, and what a shared branch saves.

    python benchmarks/paths.py [--profiles 3] [--turns 8]

Prints two tables. CPU time of one process, after a first loop.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from time import process_time

import numpy as np

from adhesis import (
    Control,
    HalfSpace,
    Problem,
    make_method,
    run_loop,
    run_loops,
    run_path,
    self_affine_profile,
)
from adhesis.solver.method import PathError

HURST, PERIOD, N0, RATIO, H_RMS = 0.8, 2e-3 * math.pi, 10, 100, 1e-6
TURNS = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]
STIFFNESSES = (1e10, 3e9, 1e9)
LOAD_STEPS = 40


def problem(seed: int, gamma: float, control: Control | None = None) -> Problem:
    """The paper's profile of one seed."""
    profile = self_affine_profile(HURST, period=PERIOD, n0=N0, ratio=RATIO, seed=seed, h_rms=H_RMS)
    return Problem(profile, HalfSpace(1e6, 0.5), gamma, control or Control())


def turning_points(seed: int) -> list[float]:
    """Audit residuals of loops that share a loading branch."""
    method = make_method("auto", problem(seed, 0.04))
    loops = run_loops(method, max_penetration=[0.3, 0.6, 0.9], load_steps=LOAD_STEPS)
    return [loop.audit_residual for loop in loops]


def minor_loops(seed: int) -> list[float]:
    """Audit residual of a path with two minor loops, and of each of them, over the whole loss."""
    method = make_method("auto", problem(seed, 0.04))
    path = run_path(method, [0.8, 0.2, 0.6, -0.5, 0.9], load_steps=LOAD_STEPS)
    return [path.audit_residual, *(m.audit_residual / path.work for m in path.minor_loops)]


def machine(stiffness: float) -> Callable[[int], list[float]]:
    """Audit residual of a loop that a stiffness holds."""

    def loop(seed: int) -> list[float]:
        method = make_method("auto", problem(seed, 0.04, Control(stiffness)))
        return [
            run_loop(method, max_penetration=0.6, load_steps=LOAD_STEPS).audit_residual,
        ]

    return loop


def load(gamma: float) -> Callable[[int], list[float]]:
    """Audit residual of a loop under a load of 500 Pa."""

    def loop(seed: int) -> list[float]:
        method = make_method("auto", problem(seed, gamma, Control(0.0)))
        return [run_loop(method, max_stress=500.0, load_steps=LOAD_STEPS).audit_residual]

    return loop


PATHS: tuple[tuple[str, Callable[[int], list[float]]], ...] = (
    ("γ = 0.04, turning points 0.3, 0.6, 0.9", turning_points),
    ("γ = 0.04, minor loops: 0.8, 0.2, 0.6, -0.5, 0.9, out", minor_loops),
    *((f"γ = 0.04, machine of {k:g} Pa/m, to u_tot/h_max = 0.6", machine(k)) for k in STIFFNESSES),
    ("γ = 0.04, load of 500 Pa", load(0.04)),
    ("γ = 0.005, load of 500 Pa", load(0.005)),
)


def audits(profiles: int) -> None:
    """Print the table of audits."""
    print("| path | profiles | largest audit residual | CPU s a path |")
    print("|---|---|---|---|")
    for name, run in PATHS:
        found: list[float] = []
        reported: list[str] = []
        started = process_time()
        for seed in range(1, profiles + 1):
            try:
                found += run(seed)
            except PathError as error:
                reported.append(str(error))
        each = (process_time() - started) / profiles
        worst = f"{np.max(np.abs(found)):.1e}" if found else ""
        if reported:
            worst = "; ".join(filter(None, [worst, f"{len(reported)}: {reported[0]}"]))
        print(f"| {name} | {profiles} | {worst} | {each:.1f} |", flush=True)


def shared(profiles: int, count: int) -> None:
    """Print what loops of several turning points cost together and apart."""
    turns = TURNS[-count:]
    for seed in range(1, profiles + 1):
        started = process_time()
        loops = run_loops(
            make_method("auto", problem(seed, 0.04)), max_penetration=turns, load_steps=LOAD_STEPS
        )
        together = process_time() - started
        started = process_time()
        apart = [
            run_loop(
                make_method("auto", problem(seed, 0.04)),
                max_penetration=turn,
                load_steps=LOAD_STEPS,
            )
            for turn in turns
        ]
        separate = process_time() - started
        differ = max(abs(a.loss / b.loss - 1) for a, b in zip(loops, apart, strict=True))
        print(
            f"seed {seed}: {count} turning points {together:.1f} s together, {separate:.1f} s "
            f"apart, {separate / together:.2f} times; losses within {differ:.1e}",
            flush=True,
        )


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--profiles", type=int, default=3)
    parser.add_argument("--turns", type=int, default=len(TURNS))
    args = parser.parse_args()
    run_loop(make_method("auto", problem(1, 0.07)), max_penetration=0.3, load_steps=4)
    audits(args.profiles)
    shared(args.profiles, args.turns)


if __name__ == "__main__":
    main()
