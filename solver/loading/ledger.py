"""Ledger of the energy along a path: what is done, stored and lost between neighbouring states.

Over an interval the driving device does the work -∫ Y dx, and the stored energy rises by ΔW/λ
(:mod:`adhesis.solver.model.control`). The rest is lost: in a jump its energy drop, in between what
edges dissipate that recede at a larger work of adhesion than they advance at,

    work = rise + loss.

Work comes from stresses and their slopes, rise and loss from energies: what the two sides differ by
is the audit. Losses, works and audits of paths and of their parts are sums over a ledger.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from adhesis.solver.model.jump import Jump
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array


@dataclass(frozen=True, eq=False)
class Ledger:
    """Energies along a path, in J/m² of nominal area.

    Arrays have the shape (states - 1,), one value for each interval between two states.

    Attributes
    ----------
    stored : array, shape (states,)
        W/λ in every state.
    works : array
        -∫ Y dx.
    displaced : array
        ∫ p̄ du_tot, the same but under a load: there it is the work of p̄ on the penetration Δ.
    losses : array
        Drop of a jump; friction between jumps.
    friction : array
        What receding edges dissipate, in jumps as a part of their drop.
    """

    stored: Array
    works: Array
    displaced: Array
    losses: Array
    friction: Array

    @classmethod
    def of(
        cls,
        problem: Problem,
        jumps: Sequence[Jump],
        *,
        separation: Array,
        mean_stress: Array,
        tangent: Array,
        contact_fraction: Array,
        elastic_energy: Array,
        adhesion_energy: Array,
        edge_friction: Array | None,
    ) -> Self:
        """Enter the states of a path, arrays of shape (states,), and the jumps between them.

        The integral is the end-corrected trapezoidal rule: with the slopes dY/dx at both ends of an
        interval its order is four on smooth pieces, and two where a slope is NaN. The arrays are
        those of :class:`~adhesis.solver.loading.equilibrium_path.EquilibriumPath`.
        """
        control, h_max, period = problem.control, problem.profile.h_max, problem.profile.period
        x = control.prescribed(separation, mean_stress)
        y = control.conjugate(separation, mean_stress, h_max)
        step = np.diff(x)
        works = np.nan_to_num(np.diff(tangent) * step**2 / 12) - 0.5 * (y[1:] + y[:-1]) * step
        lost_load = np.diff(mean_stress * (h_max - separation)) if control.is_load else 0.0
        energy = elastic_energy + adhesion_energy
        friction = np.zeros(len(step))
        if edge_friction is not None:
            friction = np.diff(edge_friction) / period
        before = states_before_jumps(jumps, separation, contact_fraction)
        losses = friction.copy()
        losses[before] = 0.0
        np.add.at(losses, before, [jump.energy_drop for jump in jumps])
        stored = control.potential(energy, separation, mean_stress, h_max, period) / period
        return cls(stored, works, works + lost_load, losses, friction)

    def part(self, first: int, stop: int) -> Ledger:
        """Return the ledger of the states from index ``first`` to the one before ``stop``."""
        between = slice(first, stop - 1)
        rest = (self.works, self.displaced, self.losses, self.friction)
        return Ledger(self.stored[first:stop], *(column[between] for column in rest))

    @property
    def work(self) -> float:
        """Work of the driving device: over a closed loop the loss."""
        return math.fsum(self.works)

    @property
    def rise(self) -> float:
        """Rise of the stored energy from the first state to the last."""
        return float(self.stored[-1] - self.stored[0])

    @property
    def loss(self) -> float:
        """Sum of the drops at jumps, and of the friction between them."""
        return math.fsum(self.losses)

    @property
    def residual(self) -> float:
        """Work less rise and loss, which the numbers are off by."""
        return self.work - self.rise - self.loss


def states_before_jumps(jumps: Sequence[Jump], separation: Array, contact: Array) -> list[int]:
    """Return the index of the state before each jump of a path; the next one is that after it.

    A jump has the numbers of both of its states, which a method returns one after the other.

    Parameters
    ----------
    jumps : sequence of Jump
        In the order of the path.
    separation, contact : array, shape (states,)
        s, and A/A0.

    Raises
    ------
    ValueError
        If the states of a jump are not among them.
    """
    contact = np.asarray(contact)
    columns = (np.asarray(separation)[:-1], contact[:-1], contact[1:])
    intervals = enumerate(zip(*(column.tolist() for column in columns), strict=True))
    found = []
    for jump in jumps:
        wanted = (jump.separation, jump.contact_before, jump.contact_after)
        before = next((k for k, interval in intervals if interval == wanted), None)
        if before is None:
            raise ValueError(
                f"no two neighbouring states are those before and after the jump at s = "
                f"{jump.separation:g} m: a method has to return both"
            )
        found.append(before)
    return found


def estimated_error(own: float, jumps: Sequence[Jump], residual: float, problem: Problem) -> float:
    """Estimate the error of a path's loss in J/m².

    It is the sum of the method's own estimate (if there is none, a hundredth of the drops), the
    residual of the audit, and the sizes of negative drops, which are errors: energy falls in every
    jump. ``own`` is NaN for a method without an estimate.
    """
    # Under a load the last drop is U, and may be negative (adhesis.solver.model.control).
    counted = [j for j in jumps if not (problem.control.is_load and j.kind == "pull-off")]
    if not math.isfinite(own):
        own = 0.01 * abs(sum(jump.energy_drop for jump in jumps))
    negative = sum(max(0.0, -jump.energy_drop) for jump in counted)
    return float(own + abs(residual) + negative)
