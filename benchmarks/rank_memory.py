"""Where the memory of a rank goes: resident MB of a process as it comes to do its work.

    python benchmarks/rank_memory.py

Each line adds something to the process: libraries, the solver, a loop of the paper's scale. "of its
own" are pages that no other process on the node shares; files of libraries are shared by all its
ranks.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path

_STEPS: list[tuple[str, Callable[[], object]]] = []


def step(name: str) -> Callable[[Callable[[], object]], Callable[[], object]]:
    """Add a step to the list."""

    def add(run: Callable[[], object]) -> Callable[[], object]:
        _STEPS.append((name, run))
        return run

    return add


def resident() -> tuple[float, float]:
    """All resident memory in MB, and what of it this process shares with none."""
    all_kb = own_kb = 0
    for line in Path("/proc/self/smaps_rollup").read_text().splitlines():
        words = line.split()
        if words[0] == "Rss:":
            all_kb = int(words[1])
        if words[0] in ("Private_Clean:", "Private_Dirty:"):
            own_kb += int(words[1])
    return all_kb * 1024 / 1e6, own_kb * 1024 / 1e6


def imported(*names: str) -> Callable[[], object]:
    """Import these."""
    return lambda: [importlib.import_module(name) for name in names]


step("Python")(lambda: None)
step("numpy")(imported("numpy"))
step("mpi4py and h5py")(imported("mpi4py.MPI", "h5py"))
packages = ("adhesis.ensemble.command.run", "adhesis.solver.sharp.method")
step("solver and ensemble")(imported(*packages))


@step("a loop, m = 10 … 1000, γ = 0.04")
def _loop(work_of_adhesion: float = 0.04) -> None:
    from adhesis import HalfSpace, Problem, make_method, run_loop, self_affine_profile

    profile = self_affine_profile(0.8, period=6.28e-3, n0=10, ratio=100, seed=1, h_rms=1e-6)
    problem = Problem(profile, HalfSpace(1e6, 0.5), work_of_adhesion)
    run_loop(make_method("sharp", problem), max_penetration=0.9, load_steps=40)


step("a loop, γ = 0.01")(lambda: _loop(0.01))


def main() -> None:
    """Measure and print."""
    print("| with | resident (MB) | more | of its own (MB) | more |")
    print("| --- | ---: | ---: | ---: | ---: |")
    before = (0.0, 0.0)
    for name, run in _STEPS:
        run()
        now = resident()
        more = [here - there for here, there in zip(now, before, strict=True)]
        print(f"| {name} | {now[0]:.0f} | {more[0]:.0f} | {now[1]:.0f} | {more[1]:.0f} |")
        before = now


if __name__ == "__main__":
    main()
