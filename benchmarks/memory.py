"""Do minor loops come back to the state that they left? Counts it on random rough profiles.

Each path loads to 0.8 h_max, then wanders: unloading, loading and unloading again between random
turning points, and goes out. Every minor loop on the way is a trial.
"""

from __future__ import annotations

import argparse

import numpy as np

from adhesis import HalfSpace, PathResult, Problem, make_method, run_path, self_affine_profile


def wander(seed: int, work_of_adhesion: float) -> PathResult:
    """One profile with wave numbers 4 to 40, one path with three minor loops."""
    rng = np.random.default_rng(seed)
    profile = self_affine_profile(0.8, period=2e-3, n0=4, ratio=10, seed=seed, h_rms=1e-6)
    problem = Problem(profile, HalfSpace(1e6, 0.5), work_of_adhesion)
    low = rng.uniform(-0.2, 0.3)
    high = rng.uniform(0.5, 0.75)
    inner_low = rng.uniform(low + 0.05, high - 0.1)
    inner_high = rng.uniform(inner_low + 0.05, high)
    path = [0.8, low, high, inner_low, inner_high]
    return run_path(make_method("auto", problem), path, load_steps=20)


def main() -> None:
    """Print how many minor loops close, and how much they lose."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--profiles", type=int, default=40)
    count = parser.parse_args().profiles
    for gamma in (0.005, 0.02):
        parts = [(part, path.work) for s in range(count) for path in [wander(s, gamma)]
                 for part in path.minor_loops]  # fmt: skip
        closed = sum(part.closes for part, _ in parts)
        away = max(abs(part.contact_change) for part, _ in parts)
        lossless = sum(part.loss < 1e-6 * work for part, work in parts)
        residual = max(abs(part.audit_residual) / work for part, work in parts)
        print(
            f"γ = {gamma} J/m²: {closed} of {len(parts)} minor loops come back to their state "
            f"(largest change of A/A0 {away:.1e}), {lossless} lose nothing; "
            f"largest audit residual {residual:.0e} of the whole loss"
        )


if __name__ == "__main__":
    main()
