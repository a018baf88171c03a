"""Losses of random mirror-symmetric profiles beside those of profiles with one phase shifted.

Those that exceed their reported error are named in docs/methods.md. Run from the repository:

    python benchmarks/symmetric_profiles.py --profiles 40
    python benchmarks/symmetric_profiles.py --profiles 4 --crests 16
"""

from __future__ import annotations

import argparse
import time
from typing import NamedTuple

import numpy as np

from adhesis import HalfSpace, LoopResult, Problem, Profile, make_method, run_loop

SOFT = HalfSpace(1e6, 0.5)
PERIOD, H_RMS, SHIFT = 2e-3, 1e-6, 1e-7
SEED = 461


class Scene(NamedTuple):
    """An even profile, the same with one phase shifted, γ, Δ~max and the load steps."""

    even: Profile
    shifted: Profile
    gamma: float
    max_penetration: float
    load_steps: int


def scene(number: int, crests: int = 0, shift: float = SHIFT) -> Scene:
    """Draw a scene of 2 to 24 waves; of ``crests`` or more crests, with 24 waves and little γ."""
    rng = np.random.default_rng([SEED, number])
    waves = 24 if crests else int(np.round(2 * 12 ** rng.uniform()))
    lowest = crests or int(rng.integers(1, 4))
    highest = lowest + int(np.ceil((waves - 1) * rng.choice([1, 1, 2])))
    others = rng.choice(np.arange(lowest + 1, highest + 1), waves - 1, replace=False)
    harmonics = np.sort(np.append(lowest, others))
    hurst = rng.uniform(0.2, 0.95)
    a = np.zeros(harmonics[-1] + 1, dtype=complex)
    a[harmonics] = harmonics ** -(hurst + 0.5) * rng.choice([-1, 1], waves)
    if rng.uniform() < 0.5:
        a[harmonics] *= rng.rayleigh(size=waves)
    a *= H_RMS / np.sqrt(2 * np.sum(np.abs(a) ** 2))
    unit = SOFT.modulus * H_RMS**2 * 2 * np.pi / PERIOD * lowest
    gamma = float(10 ** rng.uniform(-2.5, -1.5 if crests else 0.3) * unit)
    depth, steps = float(rng.uniform(0.2, 0.98)), int(rng.choice([5, 10, 20, 40]))
    shifted = a.copy()
    shifted[rng.choice(harmonics[1:])] *= np.exp(1j * shift)
    return Scene(Profile(PERIOD, a), Profile(PERIOD, shifted), gamma, depth, steps)


def run(drawn: Scene, profile: Profile, accuracy: float) -> tuple[LoopResult, float]:
    """Run a loop; also returns its CPU time in s."""
    method = make_method("sharp", Problem(profile, SOFT, drawn.gamma), accuracy=accuracy)
    started = time.process_time()
    loop = run_loop(method, max_penetration=drawn.max_penetration, load_steps=drawn.load_steps)
    return loop, time.process_time() - started


def main() -> None:
    """Print a row for each profile and accuracy, and how many are beyond either bound."""
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0] if __doc__ else None, allow_abbrev=False
    )
    parser.add_argument("--profiles", type=int, default=40)
    parser.add_argument("--crests", type=int, default=0, help="lowest wave number (drawn: 1 to 3)")
    parser.add_argument("--shift", type=float, default=SHIFT, help="of one phase, in rad")
    args = parser.parse_args()
    run(scene(0), scene(0).even, 1e-2)  # loads what is needed
    beyond = slow = count = 0
    print(
        "| profile | accuracy | loss (J/m²) | difference/loss_error | time/time | patches | races |"
    )
    for number in range(args.profiles):
        drawn = scene(number, args.crests, args.shift)
        for accuracy in (1e-2, 1e-3, 1e-4):
            (even, one), (shifted, other) = (
                run(drawn, profile, accuracy) for profile in (drawn.even, drawn.shifted)
            )
            ratio = abs(even.loss - shifted.loss) / even.loss_error
            beyond, slow, count = beyond + (ratio > 1), slow + (one > 2 * other + 0.02), count + 1
            print(
                f"| {number} | {accuracy:g} | {even.loss:.6g} | {ratio:.2g} | "
                f"{one / other:.2g} | {even.patches.max()} | {even.races}, {shifted.races} |",
                flush=True,
            )
    print(
        f"{beyond} of {count} differ by more than loss_error, {slow} take more than twice as long"
    )


if __name__ == "__main__":
    main()
