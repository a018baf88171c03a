"""Find where W~ stops depending on whether patches open: for small γ and for small amplitudes.

    python benchmarks/opening_limits.py

H = 0.8, n0 = 2, ratio 8, period 2 mm, E = 10 GPa, ν = 0.5, Δ/h_max = 0.9; a range of 0.3 nm against
zero range, one realisation.
"""

from __future__ import annotations

from adhesis import HalfSpace, LoopResult, Problem, make_method, run_loop, self_affine_profile

RANGE = 0.3e-9
# γ in J/m² and h_rms in m
WORKS = [(gamma, 1e-6) for gamma in (0.16, 0.08, 0.04, 0.02, 0.01, 0.005)]
AMPLITUDES = [(0.02, h_rms) for h_rms in (5e-7, 2.5e-7, 1.25e-7)]


def loop_of(gamma: float, h_rms: float, adhesion_range: float | None) -> LoopResult:
    """One loop of the profile, to 1e-2."""
    profile = self_affine_profile(0.8, period=2e-3, n0=2, ratio=8, seed=0, h_rms=h_rms)
    problem = Problem(profile, HalfSpace(1e10, 0.5), gamma, adhesion_range=adhesion_range)
    method = make_method("sharp", problem, accuracy=1e-2)
    return run_loop(method, max_penetration=0.9, load_steps=20)


def main() -> None:
    """Run the loops and print a row for each pair."""
    print("| γ (J/m²) | h_rms (µm) | valid_range (nm) | W~, zero range | W~, 0.3 nm | openings |")
    print("|---|---|---|---|---|---|")
    for gamma, h_rms in WORKS + AMPLITUDES:
        closed, opens = (loop_of(gamma, h_rms, given) for given in (None, RANGE))
        print(
            f"| {gamma:g} | {1e6 * h_rms:g} | {1e9 * closed.valid_range:.2g} | "
            f"{closed.loss_dimensionless:.3g} | {opens.loss_dimensionless:.3g} | "
            f"{opens.openings} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
