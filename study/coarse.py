"""Loops on a coarse grid, in steps without refinement, as a small code may take them.

    python -m study.coarse            appends to study/data/coarse.csv what it lacks

At each step the separation changes at once with the contact set fixed; then the edges move, node by
node, to the nearest lower energy. Nothing is located between steps, and the loss is the trapezoidal
rule over the steps.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

from adhesis.ensemble.campaign.tasks import task_seed
from adhesis.ensemble.report.paper import TABLE_1
from adhesis.solver.grid.contact import Contact
from adhesis.solver.grid.relax import Relaxation
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import self_affine_profile
from study.data import Array

COLUMNS = (
    *("hurst", "work_of_adhesion", "realisation", "nodes", "max_penetration", "load_step"),
    *("unloading_step", "steps", "loss_dimensionless", "pull_off_stress", "detached_at"),
    "cpu_time",
)
# Those of the plan (study/plan.md).
SEED, REALISATIONS, NODES = 1511, 10, 2048
TURNS, LOAD_STEP, UNLOADING_STEPS = (0.6, 0.7, 0.8, 0.9), 0.05, (0.05, 0.5)
FARTHEST = 100.0  # h_max between the surfaces: a contact that lasts longer is given up


class CoarsePath:
    """Contact sets on the nodes of one problem, relaxed at one separation after the other.

    Parameters
    ----------
    problem : Problem
        At a fixed separation.
    nodes : int
    """

    def __init__(self, problem: Problem, nodes: int) -> None:
        self.problem = problem
        self.relaxation = Relaxation(problem, nodes)
        self.lattice, self.solver = self.relaxation.lattice, self.relaxation.solver

    def start(self) -> Contact:
        """Return the surfaces apart, at the separation of the highest crest."""
        return self.solver.empty(self.problem.profile.h_max)

    def step(self, contact: Contact, penetration: float) -> Contact:
        """Move a relaxed contact to another Δ~ at once, and relax it there."""
        separation = (1 - penetration) * self.problem.profile.h_max
        moved = contact.copy()
        moved.prescribed = moved.separation = separation
        if not moved.mask.any() and not self.relaxation.nucleate(moved):
            return moved
        self.solver.solve(moved, self.relaxation.tight)
        relaxed = self.relaxation.relax(moved)
        assert relaxed is not None
        return relaxed

    def unload(self, contact: Contact, turn: float, step: float) -> tuple[list[float], list[float]]:
        """Return Δ~ and the mean stress in Pa of the steps from a turning point to detachment."""
        at, stress = [turn], [float(contact.stress.mean())]
        while contact.mask.any() and at[-1] > -FARTHEST:
            at.append(turn - len(at) * step)
            contact = self.step(contact, at[-1])
            stress.append(float(contact.stress.mean()))
        return at, stress


def loss_dimensionless(problem: Problem, at: Array, stress: Array) -> float:
    """Compute W~ by the trapezoidal rule over the steps of a closed loop."""
    wave_number = 2 * np.pi / problem.profile.period
    scale = 0.5 * problem.half_space.modulus * wave_number * problem.profile.h_max
    return float(np.trapezoid(stress, at) / scale)


def loops(
    problem: Problem, nodes: int, turns: tuple[float, ...], down: float, ups: tuple[float, ...]
) -> Iterator[dict[str, float]]:
    """Compute one loading branch, and from each turning point an unloading in each step.

    Parameters
    ----------
    problem : Problem
    nodes : int
    turns : tuple of float
        Δ~, ascending, multiples of ``down``.
    down, ups : float, tuple of float
        Steps of loading and of unloading, in units of h_max.
    """
    path = CoarsePath(problem, nodes)
    contact = path.start()
    at, stress = [0.0], [0.0]
    for turn in turns:
        while len(at) <= round(turn / down):
            at.append(len(at) * down)
            contact = path.step(contact, at[-1])
            stress.append(float(contact.stress.mean()))
        for up in ups:
            began = time.process_time()
            x, y = path.unload(contact, at[-1], up)
            yield {
                "nodes": nodes,
                "max_penetration": turn,
                "load_step": down,
                "unloading_step": up,
                "steps": len(x) - 1,
                "loss_dimensionless": loss_dimensionless(
                    problem, np.array(at + x), np.array(stress + y)
                ),
                "pull_off_stress": -min(y),
                "detached_at": x[-1],
                "cpu_time": time.process_time() - began,
            }


def problem_of(hurst: float, gamma: float, realisation: int) -> Problem:
    """Return a problem of the study's campaigns."""
    profile = self_affine_profile(
        hurst,
        period=6.283185307179586e-3,
        n0=10,
        ratio=100,
        h_rms=1e-6,
        seed=task_seed(SEED, realisation),
    )
    return Problem(profile, HalfSpace(1e6, 0.5), gamma)


def main() -> None:
    """Append what the table lacks."""
    path = Path(__file__).resolve().parent / "data" / "coarse.csv"
    if not path.exists():
        path.write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    known = {tuple(line.split(",")[:3]) for line in path.read_text("utf-8").splitlines()}
    for realisation, (hurst, gamma) in product(range(REALISATIONS), TABLE_1):
        if (f"{hurst:g}", f"{gamma:g}", f"{realisation}") in known:
            continue
        place = {"hurst": hurst, "work_of_adhesion": gamma, "realisation": realisation}
        problem = problem_of(hurst, gamma, realisation)
        found = [place | loop for loop in loops(problem, NODES, TURNS, LOAD_STEP, UNLOADING_STEPS)]
        lines = [",".join(f"{row[name]:.6g}" for name in COLUMNS) for row in found]
        with path.open("a", encoding="utf-8") as stream:
            stream.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
