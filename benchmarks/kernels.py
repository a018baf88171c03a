"""Time the kernels in C++ beside the functions that numba compiles, one by one.

    python benchmarks/kernels.py

On gaps of log-normal widths on the paper's roughness (H = 0.8, m = 10 … 1000, tolerance of a loop
with γ = 0.01). Prints a table in Markdown: CPU time of a call, the least of several alternating
runs, and the ratio of C++ to numba. Functions that Python does not call in a loop are repeated in
compiled code on numba's side, and called through nanobind on that of C++.
"""

from __future__ import annotations

from collections.abc import Callable
from time import CLOCK_THREAD_CPUTIME_ID, clock_gettime_ns

import numpy as np

from adhesis import HalfSpace, Problem, self_affine_profile
from adhesis.solver import _kernels  # type: ignore[attr-defined]
from adhesis.solver.runtime.jit import compiled_for_both
from adhesis.solver.sharp import native
from adhesis.solver.sharp.descent import implicit_flow
from adhesis.solver.sharp.equilibrium import condensed, renewal, response_setup
from adhesis.solver.sharp.equilibrium.gap_response import condense_gap, linearise_gap
from adhesis.solver.sharp.equilibrium.linear_response import solve_response
from adhesis.solver.sharp.equilibrium.renewal import factor_runs
from adhesis.solver.sharp.field import hierarchical_solver, separate_gaps
from adhesis.solver.sharp.gap.chebyshev_moments import gap_moments
from adhesis.solver.sharp.gap.conformal_map import map_gaps
from adhesis.solver.sharp.gap.quadrature import GAUSS_RULES, choose_orders
from adhesis.solver.sharp.mechanics import EdgeMechanics
from adhesis.solver.sharp.method import SharpMethod

_ROUNDS = 7


@compiled_for_both
def _moments(table, panels, modes, times) -> None:  # type: ignore[no-untyped-def]
    s, ends = np.empty((modes, 2)), np.empty((2, 2))
    for _ in range(times):
        gap_moments(table[0], panels, s, ends)


@compiled_for_both
def _linearise(response, law, model, times) -> None:  # type: ignore[no-untyped-def]
    for _ in range(times):
        linearise_gap(response, 0, law, model)


@compiled_for_both
def _condense(response, model, times) -> None:  # type: ignore[no-untyped-def]
    for _ in range(times):
        condense_gap(response, 0, model.rules)


@compiled_for_both
def _factor(response, times) -> None:  # type: ignore[no-untyped-def]
    changed = np.ones(response.held.shape[0], dtype=np.bool_)
    for _ in range(times):
        factor_runs(response, changed)


@compiled_for_both
def _solve(response, prescribed, law, device, times) -> None:  # type: ignore[no-untyped-def]
    for _ in range(times):
        solve_response(response, prescribed, law, device)


def _gaps(count: int, contact: float, spread: float) -> np.ndarray:
    widths = np.exp(spread * np.random.default_rng(0).standard_normal((count, 2)))
    widths *= 2 * np.pi * np.array([1 - contact, contact]) / widths.sum(axis=0)
    ends = 0.1 + np.cumsum(widths.ravel())
    return np.concatenate([[0.1], ends[:-1]]).reshape(-1, 2)


def _time(call: Callable[[], object], times: int) -> float:
    before = clock_gettime_ns(CLOCK_THREAD_CPUTIME_ID)
    for _ in range(times):
        call()
    return (clock_gettime_ns(CLOCK_THREAD_CPUTIME_ID) - before) * 1e-3 / times


def _row(name: str, theirs: Callable[[], object], ours: Callable[[], object], inner: int) -> None:
    """Alternate; ``inner`` repetitions are inside ``theirs``, or 0 if both are single calls."""
    theirs(), ours()
    single = max(_time(ours, 3), 0.2)
    times = max(3, min(20000, int(20e3 / single)))
    of_numba, of_cxx = [], []
    for _ in range(_ROUNDS):
        if inner:
            of_numba.append(_time(theirs, max(1, times // inner)) / inner)
        else:
            of_numba.append(_time(theirs, times))
        of_cxx.append(_time(ours, times))
    least, also = min(of_numba), min(of_cxx)
    print(f"| {name} | {least:.2f} | {also:.2f} | {also / least:.2f} |", flush=True)


def main() -> None:
    """Measure and print."""
    profile = self_affine_profile(0.8, period=2e-3 * np.pi, n0=10, ratio=100, seed=1, h_rms=1e-6)
    edges = SharpMethod(Problem(profile, HalfSpace(1e6, 0.5), 0.01)).edges
    print("| function | gaps | numba, µs | C++, µs | ratio |\n| --- | ---: | ---: | ---: | ---: |")
    for count in (8, 65):
        _measure(count, edges)
    print(
        f"\nA call of C++ that does nothing: {_time(lambda: _kernels.nothing(1.0), 100000):.3f} µs"
    )


def _measure(count: int, edges: EdgeMechanics) -> None:
    """Print the rows of so many gaps."""
    law, model, device = edges.law, edges.model, edges.model.device
    of_law, of_model = native.law_of(law), native.model_of(model)
    gaps, d = _gaps(count, 0.3, 0.5), 1e-3
    table = map_gaps(gaps)
    orders = choose_orders(table, model.digits, GAUSS_RULES.counts)
    modes = int(GAUSS_RULES.counts[orders[0]])
    theirs, _ = response_setup.set_up_response(gaps, d, orders, law, model)
    ours, _ = native.set_up_response(gaps, d, orders, law, model)
    kernel = ours.kernel
    solve_args = gaps, d, orders
    moved = gaps + 1e-5 * np.sin(np.arange(gaps.size)).reshape(-1, 2)
    some = np.arange(0, gaps.size, 4)
    n = int(GAUSS_RULES.counts[orders].sum())
    potential = 1e-3 * np.random.default_rng(1).standard_normal(n)
    none = np.empty(0, dtype=np.int64)
    fewer = np.delete(gaps, count // 2, axis=0)

    def descend(module: object, response: object, gaps: np.ndarray = gaps) -> object:
        runs = np.zeros(gaps.size, dtype=bool)
        return module.descend(  # type: ignore[attr-defined]
            response, gaps, 1e-3, 3, False, runs, 12.0, law, model
        )

    rows = [
        (
            f"moments of a gap, {modes} modes", 100,
            lambda: _moments(table, model.panels, modes, 100),
            lambda: _kernels.gap_moments(table, 0, of_model, modes, 2),
        ),
        (
            "linearise a gap", 100,
            lambda: _linearise(theirs, law, model, 100),
            lambda: kernel.linearise(0, of_law, of_model),
        ),
        (
            "condense a gap", 100,
            lambda: _condense(theirs, model, 100), lambda: kernel.condense(0, of_model),
        ),
        ("factor all runs", 10, lambda: _factor(theirs, 10), kernel.factor_runs),
        (
            "solve the response", 100,
            lambda: _solve(theirs, d, law, device, 100),
            lambda: kernel.solve(d, of_law, of_model),
        ),
        (
            "tangent of every fourth edge", 0,
            lambda: condensed.tangent_between(theirs, some, d, law, device),
            lambda: native.tangent_between(ours, some, d, law, device),
        ),
        (
            "field", 0,
            lambda: hierarchical_solver.solve_many(*solve_args, 1, model),
            lambda: _kernels.solve_field(*solve_args, of_model),
        ),
        (
            "every gap in a known potential", 0,
            lambda: separate_gaps.solve_separately(
                gaps, table, orders, potential, -0.02, d, model
            ),
            lambda: _kernels.solve_separately(
                gaps, table, orders, potential, -0.02, d, of_model
            ),
        ),
        (
            "set up a response", 0,
            lambda: response_setup.set_up_response(*solve_args, law, model),
            lambda: native.set_up_response(*solve_args, law, model),
        ),
        (
            "response with a gap less", 0,
            lambda: response_setup.update_response(theirs, fewer, d, none, law, model),
            lambda: native.update_response(ours, fewer, d, none, law, model),
        ),
        (
            "move all edges, and back", 0,
            lambda: [renewal.settle_response(theirs, g, d, law, model) for g in (moved, gaps)],
            lambda: [native.settle_response(ours, g, d, law, model) for g in (moved, gaps)],
        ),
        (
            "descent, 3 solutions", 0,
            lambda: descend(implicit_flow, theirs), lambda: descend(native, ours),
        ),
    ]  # fmt: skip
    for name, inner, of_numba, of_cxx in rows:
        _row(f"{name} | {count}", of_numba, of_cxx, inner)


if __name__ == "__main__":
    main()
