"""Unload a surface of many patches by ``grid``, from a state of ``sharp``.

    python benchmarks/unloading.py --nodes-per-wave 8 16 32

A whole loop of 854 patches by a fine grid takes hours, nearly all of it while many patches part.
So ``sharp`` follows the loop, and ``grid`` takes it over in the middle of unloading, before the
last avalanches, where the works of both differ most. Prints the work in J/m² from there to the end
of contact, and where contact ends.
"""

from __future__ import annotations

import argparse
from time import process_time

import numpy as np

from adhesis import HalfSpace, Problem, run_loop, self_affine_profile
from adhesis.solver.grid.method import GridMethod
from adhesis.solver.grid.states import state_of
from adhesis.solver.method import ContactState
from adhesis.solver.sharp.method import SharpMethod

_STEP = 1e-7  # m
_INSET = 0.31  # nodes by which the outer face of a contact node lies beyond an edge, less a half


def on_grid(method: GridMethod, state: ContactState) -> ContactState:
    """Relax the contact set of another method's state on the nodes of a grid."""
    lattice = method.lattice
    contact = method.solver.empty(state.separation)
    contact.prescribed = state.separation
    for left, right in state.edges / lattice.dx:
        right += lattice.n * (right < left)
        first = int(np.ceil(left - _INSET))
        last = max(first, int(np.floor(right + _INSET)))
        contact.mask[np.arange(first, last + 1) % lattice.n] = True
    method.solver.solve(contact, method.relaxation.tight)
    relaxed = method.relaxation.relax(contact)
    assert relaxed is not None
    return state_of(lattice, relaxed)


def unload(method: GridMethod, state: ContactState) -> list[ContactState]:
    """Follow a state until contact has ended."""
    states = [state]
    while states[-1].patches:
        states += method.follow(states[-1], states[-1].separation + _STEP).states
    return states


def row(name: str, states: list[ContactState], seconds: float) -> str:
    """Make the row of a table: patches at first, end of contact in µm, work, CPU seconds."""
    separation = [state.separation for state in states]
    work = np.trapezoid([state.mean_stress for state in states], separation)
    end = next(state.separation for state in states if not state.patches)
    return f"| {name} | {states[0].patches} | {1e6 * end:.2f} | {work:.4g} | {seconds:.0f} |"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--work-of-adhesion", type=float, default=0.0006)
    parser.add_argument("--waves", type=int, default=1020, help="lowest harmonic")
    parser.add_argument("--ratio", type=float, default=4.0, help="of highest to lowest harmonic")
    parser.add_argument("--max-penetration", type=float, default=0.62)
    parser.add_argument("--load-steps", type=int, default=31)
    parser.add_argument("--separation", type=float, default=4.85e-6, help="in m")
    parser.add_argument("--nodes-per-wave", type=int, nargs="+", default=[8, 16])
    given = parser.parse_args()
    profile = self_affine_profile(
        0.8, period=2e-4 * np.pi * given.waves, n0=given.waves, ratio=given.ratio, seed=1,
        h_rms=1e-6,
    )  # fmt: skip
    problem = Problem(profile, HalfSpace(1e6, 0.5), given.work_of_adhesion)
    print("| method | patches | contact ends at µm | work, J/m² | CPU s |")
    print("|" + " ---: |" * 5, flush=True)
    started = process_time()
    loop = run_loop(
        SharpMethod(problem), max_penetration=given.max_penetration, load_steps=given.load_steps
    )
    states = list(loop.contact_states)
    turn = int(np.argmin([state.separation for state in states]))
    begin = max(k for k in range(turn, len(states)) if states[k].separation <= given.separation)
    print(row("sharp, whole loop", states[begin:], process_time() - started), flush=True)
    for nodes in given.nodes_per_wave:
        method = GridMethod(problem, nodes_per_wave=nodes)
        started = process_time()
        unloaded = unload(method, on_grid(method, states[begin]))
        print(row(f"grid, {nodes} nodes", unloaded, process_time() - started), flush=True)


if __name__ == "__main__":
    main()
