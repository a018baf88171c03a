"""Loops on a coarse grid, in steps without refinement, as a small code may take them.

At each step the separation changes at once with the contact set fixed; then the edges move, node by
node, to the nearest lower energy. Nothing is located between steps, and the loss is the trapezoidal
rule over the steps.
"""

from __future__ import annotations

import csv
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem
from adhesis.solver.grid.contact import Contact, ContactSolver
from adhesis.solver.grid.lattice import Lattice
from adhesis.solver.grid.relax import Relaxation
from adhesis.solver.model.profile import self_affine_profile
from adhesis.ensemble.campaign.tasks import task_seed
from tools.study.data import Array

COLUMNS = (
    *("hurst", "work_of_adhesion", "realisation", "nodes", "max_penetration", "steps"),
    *("unloading_steps", "loss_dimensionless", "pull_off_stress", "detached_at", "cpu_time"),
)
FARTHEST = 100.0  # Δ/h_max at which an unloading that has not detached is given up


@dataclass(frozen=True)
class Ladder:
    """Steps of one loop, in units of h_max.

    Attributes
    ----------
    turn : float
        Δ~ of the turning point.
    down, up : float
        Step of loading and of unloading.
    """

    turn: float
    down: float
    up: float


class CoarseLoop:
    """Contact sets on ``nodes`` nodes of one problem, relaxed at one separation after the other."""

    def __init__(self, problem: Problem, nodes: int) -> None:
        profile = problem.profile
        self.problem = problem
        self.lattice = Lattice.of(problem, nodes)
        closing = self.lattice.closing_gap(problem.work_of_adhesion, float(np.sqrt(profile.m4)))
        solver = ContactSolver(self.lattice.elastic, self.lattice.height, closing, problem.control)
        self.relaxation = Relaxation(
            self.lattice,
            solver,
            longest_step=max(1, int(0.1 * profile.shortest_wavelength / self.lattice.dx)),
            loose=0.02,
            tight=1e-4,
        )

    def step(self, contact: Contact, penetration: float) -> Contact:
        """Move a relaxed contact to another Δ~ at once, and relax it there."""
        moved = contact.at((1 - penetration) * self.problem.profile.h_max, self.problem.control)
        if moved.mask.any():
            self.relaxation.solver.solve(moved, self.relaxation.tight)
        elif not self.relaxation.nucleate(moved):
            return moved
        else:
            self.relaxation.solver.solve(moved, self.relaxation.tight)
        relaxed = self.relaxation.relax(moved)
        assert relaxed is not None
        return relaxed

    def run(self, ladder: Ladder) -> tuple[Array, Array]:
        """Return Δ~ and the mean stress in Pa of all steps, loading and unloading."""
        contact = self.relaxation.solver.empty(self.problem.profile.h_max)
        count = round(ladder.turn / ladder.down)
        at, stress = [0.0], [0.0]
        for penetration in ladder.turn * np.arange(1, count + 1) / count:
            contact = self.step(contact, float(penetration))
            at.append(float(penetration))
            stress.append(float(contact.stress.mean()))
        while contact.mask.any() and at[-1] > -FARTHEST:
            at.append(at[-1] - ladder.up)
            contact = self.step(contact, at[-1])
            stress.append(float(contact.stress.mean()))
        return np.array(at), np.array(stress)


def loss_dimensionless(problem: Problem, at: Array, stress: Array) -> float:
    """Compute W~ by the trapezoidal rule over the steps."""
    wave_number = 2 * np.pi / problem.profile.period
    scale = 0.5 * problem.half_space.modulus * wave_number * problem.profile.h_max
    return float(np.trapezoid(stress, at) / scale)
