"""Cost of a field of many gaps on the tree of gaps.

    python benchmarks/many_gaps.py --gaps 30 100 300 1000 3000

Random gaps and patches (log-normal widths, spread 0.7) over the paper's spectrum. Best of a few
repetitions, in CPU time; the exponent is that between one number of gaps and the next. On the tree
the linear response of all edges is set up from nothing, with the field; a step is Newton's of all
edges on it, with their stability.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from time import process_time
from typing import Any

import numpy as np

from adhesis.solver._kernels import FieldModel, set_up_response, solve_field
from adhesis.solver.model.profile import Array, self_affine_profile
from adhesis.solver.sharp.gap.full_contact_stress import StressSource
from adhesis.solver.sharp.mechanics import FIXED_SEPARATION, EdgeMechanics

_TOUGHNESS = 1e-3  # critical opening: that of edges which are hardly in balance


def random_gaps(count: int, contact: float, spread: float = 0.7, seed: int = 1) -> Array:
    """Ends of ``count`` gaps, shape (count, 2), the patches covering ``contact`` of the period."""
    random = np.random.default_rng(seed)
    widths = np.exp(spread * random.standard_normal((count, 2)))
    widths *= 2 * np.pi * np.array([1 - contact, contact]) / widths.sum(axis=0)
    ends = 0.1 + np.cumsum(widths.ravel())
    return np.concatenate([[0.1], ends[:-1]]).reshape(-1, 2)


def _best(work: Callable[[], Any], repetitions: int) -> tuple[float, Any]:
    times = []
    for _ in range(repetitions):
        started = process_time()
        result = work()
        times.append(process_time() - started)
    return min(times), result


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--gaps", type=int, nargs="+", default=[30, 100, 300, 1000, 3000])
    parser.add_argument("--contact", type=float, default=0.3)
    parser.add_argument("--tolerance", type=float, default=1e-5)
    parser.add_argument("--repetitions", type=int, default=5)
    given = parser.parse_args()
    profile = self_affine_profile(0.8, period=2e-3 * np.pi, n0=10, ratio=100, h_rms=1e-6, seed=1)
    source = StressSource(profile, given.tolerance)
    separation, digits = 0.5 * profile.h_max * profile.q0, -np.log(given.tolerance)
    model = FieldModel(FIXED_SEPARATION, float(digits), source.panels)
    law = EdgeMechanics(source, _TOUGHNESS, given.tolerance).law
    print(f"contact {given.contact}, tolerance {given.tolerance}; times in ms")
    print("  gaps  unknowns    field   per gap (µs)  exponent response     step")
    before = (0, 0.0)
    for count in given.gaps:
        gaps = random_gaps(count, given.contact)
        solve_field(gaps, separation, model)
        time, of = _best(partial(solve_field, gaps, separation, model), given.repetitions)
        new = partial(set_up_response, gaps, separation, law, model)
        set_up, response = _best(new, given.repetitions)
        step, _ = _best(partial(response.solve, separation, law, model), given.repetitions)
        exponent = ""
        if before[0]:
            exponent = f"{np.log(time / before[1]) / np.log(count / before[0]):.2f}"
        before = (count, time)
        print(
            f"{count:6d} {len(of.theta):9d} {1e3 * time:8.2f} {1e6 * time / count:14.1f} "
            f"{exponent:>9s} {1e3 * set_up:8.2f} {1e3 * step:8.2f}"
        )


if __name__ == "__main__":
    main()
