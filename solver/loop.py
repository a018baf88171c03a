"""The loading path: one complete loading-unloading loop, its losses and its energy audit.

dU/ds = -λ p̄ at equilibrium, so over a closed loop the loop integral of the mean stress and the sum
of the energy drops at the jumps are the same energy. They are computed independently of each other
(stresses against energies), and their difference is the audit of the loop.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.jumps import Jump
from solver.method import Branch, ContactState, Method
from solver.problem import Problem
from solver.profile import Array

Progress = Callable[[Branch, float, ContactState], None]
"""Called after each load step with branch, penetration Δ/h_max and state; may raise to stop."""

# Unloading has always detached long before this many times the loading stroke; more is a bug.
_MAX_UNLOADING_STROKES = 1000


@dataclass(frozen=True, eq=False)
class LoopResult:
    """A complete loop; arrays have the shape (states,), in the order of the path.

    Attributes
    ----------
    problem : Problem
    max_penetration : float
        Δ/h_max at the turning point, as asked for.
    load_steps : int
        Equal steps of the loading branch.
    branch : array of str, shape (states,)
        "loading" or "unloading".
    load_step : bool array
        True at the states on the uniform axis of load steps, False at those that the method added
        in between (before and after jumps, and where the curve bends).
    penetration : array
        Δ/h_max.
    separation : array
        s in m.
    mean_stress : array
        p̄ in Pa, compression positive.
    contact_fraction : array
        A/A0.
    patches : int array
    elastic_energy, adhesion_energy : array
        In J/m, per period.
    jumps : tuple of Jump
    loss : float
        ∮ p̄ dΔ in J/m² of nominal area, over all states (:func:`integral`).
    loss_dimensionless : float
        W~ = ∮ σ~ dΔ~ with Δ~ = Δ/h_max and σ~ = 2p̄/(E* q0 h_max).
    loss_from_drops : float
        Sum of the energy drops at the jumps, in J/m².
    seconds : float
        CPU time of this process, in s.
    method : dict
        What the method says of itself (name, resolution, counters).

    References
    ----------
    docs/theory.md, "3. The loop"
    """

    problem: Problem = field(repr=False)
    max_penetration: float
    load_steps: int
    branch: NDArray[np.str_]
    load_step: NDArray[np.bool_]
    penetration: Array
    separation: Array
    mean_stress: Array
    contact_fraction: Array
    patches: NDArray[np.int64]
    elastic_energy: Array
    adhesion_energy: Array
    jumps: tuple[Jump, ...]
    loss: float
    loss_dimensionless: float
    loss_from_drops: float
    seconds: float
    method: dict[str, Any]

    @property
    def energy(self) -> Array:
        """U in J/m, per period, shape (states,)."""
        return self.elastic_energy + self.adhesion_energy

    @property
    def audit_residual(self) -> float:
        """(loop integral - sum of drops) / loop integral; 0 for a loop without loss."""
        return (self.loss - self.loss_from_drops) / self.loss if self.loss else 0.0

    @property
    def pull_off_penetration(self) -> float:
        """Δ/h_max of the state that has lost all contact."""
        return float(self.penetration[-1])

    @property
    def pull_off_stress(self) -> float:
        """Largest mean tension on unloading, -min p̄, in Pa."""
        return float(-self.mean_stress[self.branch == "unloading"].min())

    def __str__(self) -> str:
        """A few lines for a terminal: what was followed, its losses, its jumps, its pull-off."""
        profile = self.problem.profile
        kinds = Counter(jump.kind for jump in self.jumps)
        several = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
        return "\n".join(
            (
                f"profile    h_max = {profile.h_max:.4g} m, m2 = {profile.m2:.4g}, "
                f"period {profile.period:.4g} m",
                f"loop       γ = {self.problem.work_of_adhesion:.4g} J/m², "
                f"Δ/h_max up to {self.max_penetration:.4g} in {self.load_steps} load steps, "
                f"method {self.method['name']}",
                f"loss       {self.loss:.5g} J/m² (W~ = {self.loss_dimensionless:.5g}); "
                f"sum of drops {self.loss_from_drops:.5g} J/m²",
                f"jumps      {len(self.jumps)}{f' ({several})' if several else ''}",
                f"pull-off   {self.pull_off_stress:.4g} Pa, "
                f"out of contact at Δ/h_max = {self.pull_off_penetration:.4g}",
                f"states     {len(self.separation)}, {self.seconds:.2g} s of CPU time",
            )
        )

    def states(self, branch: Branch, load_steps_only: bool = False) -> NDArray[np.intp]:
        """Indices of the states of one branch, optionally only those on the load-step axis."""
        chosen = self.branch == branch
        return np.flatnonzero(chosen & self.load_step if load_steps_only else chosen)


def integral(separation: Array, mean_stress: Array, stiffness: Array) -> float:
    """∫ p̄ ds over the states, in J/m²: trapezoidal rule, end-corrected where dp̄/ds is known.

    The correction h²/12 (p̄'_0 - p̄'_1) raises the order from two to four on smooth pieces; it is
    left out where a stiffness is NaN.

    Parameters
    ----------
    separation, mean_stress, stiffness : array, shape (states,)
        In m, Pa and Pa/m, in the order of the path.
    """
    bend = -np.diff(stiffness) * np.diff(separation) ** 2 / 12
    return float(np.trapezoid(mean_stress, separation)) + float(np.nansum(bend))


def check_cycle(max_penetration: float, load_steps: int) -> None:
    """Refuse a cycle that cannot be run.

    Raises
    ------
    ValueError
        Unless 0 < max_penetration < 1 and load_steps is a whole number of at least 1.
    """
    if not (np.isfinite(max_penetration) and 0 < max_penetration < 1):
        raise ValueError(
            f"max_penetration is {max_penetration!r}: it must lie between 0 and 1, both excluded "
            "(in units of h_max; at 1 the mean gap would be zero, and no such state exists)"
        )
    if load_steps != int(load_steps) or load_steps < 1:
        raise ValueError(f"load_steps is {load_steps!r}: it must be a whole number of at least 1")


def run_loop(
    method: Method,
    *,
    max_penetration: float,
    load_steps: int,
    progress: Progress | None = None,
    on_state: Callable[[Branch, ContactState], None] | None = None,
) -> LoopResult:
    """Load from first touch to ``max_penetration``, then unload until detached.

    Parameters
    ----------
    method : Method
    max_penetration : float
        Δ~max = Δ/h_max, 0 < Δ~max < 1.
    load_steps : int
        Equal steps of the loading branch; unloading goes on with the same step.
    progress : callable, optional
        See :data:`Progress`.
    on_state : callable, optional
        Called with every state of the path, in order (for fields at chosen penetrations).

    Raises
    ------
    ValueError
        If the cycle cannot be run (:func:`check_cycle`).
    RuntimeError
        If the contact has not detached after a thousand loading strokes.

    References
    ----------
    docs/theory.md, "3. The loop"
    """
    check_cycle(max_penetration, load_steps)
    started = process_time()
    problem = method.problem
    h_max = problem.profile.h_max
    record: list[tuple[Branch, bool, ContactState]] = []
    jumps: list[Jump] = []

    def visit(branch: Branch, on_axis: bool, state: ContactState) -> None:
        record.append((branch, on_axis, state))
        if on_state is not None:
            on_state(branch, state)

    def step(branch: Branch, state: ContactState, index: int) -> ContactState:
        target = problem.separation(max_penetration * index / load_steps)
        path = method.follow(state, target)
        for passed in path.states[:-1]:
            visit(branch, False, passed)
        visit(branch, True, path.states[-1])
        jumps.extend(path.jumps)
        if progress is not None:
            progress(branch, max_penetration * index / load_steps, path.states[-1])
        return path.states[-1]

    state = method.detached(h_max)
    visit("loading", False, state)
    for i in range(load_steps + 1):
        state = step("loading", state, i)
    # The turning point belongs to both branches: it starts the unloading curve.
    visit("unloading", True, state)
    i = load_steps
    while state.patches:
        i -= 1
        if load_steps - i > _MAX_UNLOADING_STROKES * load_steps:
            raise RuntimeError(f"still in contact at Δ/h_max = {max_penetration * i / load_steps}")
        state = step("unloading", state, i)

    separation = np.array([s.separation for _, _, s in record])
    mean_stress = np.array([s.mean_stress for _, _, s in record])
    stiffness = np.array([s.stiffness for _, _, s in record])
    loss = -integral(separation, mean_stress, stiffness)  # dΔ = -ds
    return LoopResult(
        problem=problem,
        max_penetration=max_penetration,
        load_steps=load_steps,
        branch=np.array([b for b, _, _ in record]),
        load_step=np.array([on_axis for _, on_axis, _ in record]),
        penetration=1.0 - separation / h_max,
        separation=separation,
        mean_stress=mean_stress,
        contact_fraction=np.array([s.contact_fraction for _, _, s in record]),
        patches=np.array([s.patches for _, _, s in record], dtype=np.int64),
        elastic_energy=np.array([s.elastic_energy for _, _, s in record]),
        adhesion_energy=np.array([s.adhesion_energy for _, _, s in record]),
        jumps=tuple(jumps),
        loss=loss,
        loss_dimensionless=loss / problem.loss_scale,
        loss_from_drops=float(sum(j.energy_drop for j in jumps)),
        seconds=process_time() - started,
        method={"name": method.name, "chosen": method.chosen, **method.describe()},
    )
