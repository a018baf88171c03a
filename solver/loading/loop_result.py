"""Result of a loop: its curves, losses and energy audit.

dU/ds = -λ p̄ at equilibrium, so over a closed loop the loop integral of the mean stress and the sum
of the energy drops at the jumps are the same energy. They are computed independently of each other
(stresses against energies), and their difference is the audit of the loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.checks import STRESS, choice, counted, real, reals
from adhesis.solver.loading.equilibrium_path import (
    EquilibriumPath,
    path_fields,
    with_turn_range,
)
from adhesis.solver.loading.loop_state import LoopState, state_at_stress
from adhesis.solver.loading.mean_stress_event import has_reached
from adhesis.solver.loading.path_record import Record
from adhesis.solver.loading.zero_range import stress_text
from adhesis.solver.method import PathError
from adhesis.solver.model.control import Control
from adhesis.solver.model.jump import BRANCHES, Branch
from adhesis.solver.model.profile import Array


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LoopResult(EquilibriumPath):
    """A complete loop; arrays have the shape (states,), in the order of the path.

    Its states and jumps are the attributes of :class:`EquilibriumPath`: ``branch``,
    ``penetration``, ``separation``, ``mean_stress``, ``contact_fraction``, ``patches``, ``jumps``,
    ``contact_states`` …

    Attributes
    ----------
    turning_point : float
        As prescribed: Δ/h_max, u_tot/h_max if the control is a stiffness, p̄ in Pa under a load.
        With a preload the value that was reached.
    max_penetration : float
        Δ/h_max at the turning point: prescribed, or computed if the control does not fix it.
    preload : float or None
        Mean stress in Pa at which the path was to turn.
    loss : float
        ∮ p̄ dΔ in J/m² of nominal area, over all states
        (:class:`adhesis.solver.loading.ledger.Ledger`).
    loss_dimensionless : float
        W~ = ∮ σ~ dΔ~ with Δ~ = Δ/h_max and σ~ = 2p̄/(E* q0 h_max).
    work_gained, work_spent : float
        Work that is gained on loading and spent on unloading, in J/m² of nominal area: ∓∫ p̄ du_tot
        along the branch, jumps included; under a load u_tot is Δ. Their difference is the loss.

    References
    ----------
    docs/theory.md, "3. The loop"

    Examples
    --------
    >>> from adhesis import HalfSpace, Problem, make_method, run_loop, single_wave
    >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
    >>> loop = run_loop(make_method("sharp", problem), max_penetration=0.5, load_steps=4)
    >>> [jump.kind for jump in loop.jumps]
    ['snap-in', 'pull-off']
    """

    turning_point: float
    max_penetration: float
    loss: float
    loss_dimensionless: float
    work_gained: float
    work_spent: float
    preload: float | None = None

    _numbers = (
        *("turning_point", "max_penetration", "turning_stress", "preload", "preload_reached"),
        *("loss", "loss_dimensionless", "work_gained"),
        *("work_spent", "effective_work_of_approach", "effective_work_of_separation"),
        *("pull_off_stress", "pull_off_penetration"),
    )

    def __repr__(self) -> str:
        """Return two lines with the loop and its loss, and the number of warnings."""
        weight = "under a weight, " if self.problem.control.is_load else ""
        return (
            f"LoopResult({weight}turning_point={self.turning_point:g}, "
            f"{self.load_steps} load steps, "
            f"{len(self.separation)} states, method {self.method.name!r},\n"
            f"  loss={self.loss:.6g} J/m², loss_error={self.loss_error:.2g} J/m², "
            f"least_range={self.least_range:.3g} m, {counted(len(self.jumps), 'jump')}, "
            f"{counted(len(self.warnings), 'warning')})"
        )

    @property
    def lost(self) -> float:
        """The loss."""
        return self.loss

    @property
    def scale_of_errors(self) -> float:
        """The loss."""
        return abs(self.loss)

    @property
    def audit_residual(self) -> float:
        """(loop integral - drops and friction) / loop integral; 0 for a loop without loss.

        Without adhesion there is no loss: the loop integral is only rounding, and counts as such in
        ``loss_error``.
        """
        if self.problem.work_of_adhesion == 0:
            return 0.0
        return (self.loss - self.loss_from_drops) / self.loss if self.loss else 0.0

    @property
    def turning_stress(self) -> float:
        """Mean stress p̄ in Pa at the turning point."""
        return float(self.mean_stress[self.branch == "unloading"][0])

    @property
    def preload_reached(self) -> bool | None:
        """Whether the mean stress reached the preload; None without one."""
        if self.preload is None:
            return None
        return has_reached(self.turning_stress, self.preload)

    @property
    def _turned_after_jump(self) -> bool:
        """Whether the last state of loading is the end of a jump."""
        last = int(np.count_nonzero(self.branch == "loading")) - 1
        return last - 1 in self.states_before_jumps()

    @property
    def _where(self) -> str:
        """Turning point as prescribed, for a message."""
        control, point = self.problem.control, self.turning_point
        if control.is_load:
            return f"p̄ = {stress_text(point)}"
        return f"{'Δ' if control.is_fixed else 'u_tot'}/h_max = {point:.6g}"

    @property
    def preload_warnings(self) -> list[str]:
        """Return a sentence where the mean stress does not reach the preload, or jumps beyond."""
        if self.preload is None:
            return []
        if not self.preload_reached:
            loading = np.where(self.branch == "loading", self.mean_stress, -np.inf)
            highest = int(loading.argmax())
            most = (
                f"at most {stress_text(loading[highest])}, at Δ/h_max = "
                f"{self.penetration[highest]:.4g}"
            )
            if loading[highest] <= 0:
                most = "a tension in every state of contact"
            return [
                f"the preload of {stress_text(self.preload)} is not reached: on loading the mean "
                f"stress is {most}; the loop turns at {self._where}, with "
                f"{stress_text(self.turning_stress)}"
            ]
        if self._turned_after_jump:
            return [
                f"a jump goes beyond the preload of {stress_text(self.preload)}: the loop turns at "
                f"its end, with {stress_text(self.turning_stress)}"
            ]
        return []

    def _warnings_of_way(self) -> list[str]:
        return self.preload_warnings + self.fall_warnings()

    @property
    def pull_off_penetration(self) -> float:
        """Δ/h_max of the state that has lost all contact."""
        return float(self.penetration[-1])

    @property
    def pull_off_stress(self) -> float:
        """Largest mean tension on unloading, -min p̄, in Pa."""
        return float(0.0 - self.mean_stress[self.branch == "unloading"].min())

    @property
    def effective_work_of_approach(self) -> float:
        """Work gained per largest contact area, in J/m² of contact."""
        return self.work_gained / self.largest_contact_fraction

    @property
    def effective_work_of_separation(self) -> float:
        """Work spent per largest contact area, in J/m² of contact."""
        return self.work_spent / self.largest_contact_fraction

    def _rows_of_way(self, contact: str) -> list[tuple[str, str]]:
        share, note = self._share_and_note(self.loss)
        return [
            (
                "cycle",
                f"{self._way} in {self.load_steps} load steps, detached by "
                f"{self.pull_off_penetration:.4g} h_max; {contact}",
            ),
            (
                "loss",
                f"{self.loss:.6g} J/m²{share} (dimensionless {self.loss_dimensionless:.6g}){note}",
            ),
        ]

    def _rows_of_end(self) -> list[tuple[str, str]]:
        return [("pull-off", f"mean tension {self.pull_off_stress:.6g} Pa")]

    @property
    def turning_text(self) -> str:
        """Return how the loop turned, for a terminal: at which preload, stress or penetration."""
        where = self._where
        if self.preload is None:
            return where
        preload = stress_text(self.preload)
        if not self.preload_reached:
            return f"{where}, before the preload of {preload} is reached"
        if self._turned_after_jump:
            beyond = stress_text(self.turning_stress)
            return f"{where}, the end of a jump from below the preload of {preload} to {beyond}"
        return f"the preload of {preload}, at {where}"

    @property
    def _way(self) -> str:
        """Where it turned, for the summary."""
        control, point = self.problem.control, self.turning_point
        held, depth = "", ""
        if not (control.is_fixed or control.is_load):
            held = f"held by {control.stiffness:.4g} Pa/m, "
            depth = f" (penetration {self.max_penetration:.4g} h_max)"
        if self.preload is not None:
            return f"{held}turning at {self.turning_text}{depth}"
        if control.is_load:
            return f"under a load to {point:g} Pa"
        way = f"{held}far side to" if held else "to penetration"
        return f"{way} {point:g} h_max{depth}"

    def on_axis(self, branch: Branch, values: Array, most: float = math.inf) -> Array:
        """Return values of one branch at every load step, interpolated at skipped ones.

        Parameters
        ----------
        branch : {"loading", "unloading"}
        values : array, shape (states,)
        most : float
            Load steps of unloading at most; to contact with a soft spring there may be billions.

        Returns
        -------
        array, shape (load steps from the branch's first state on the axis to its last,)

        Raises
        ------
        ValueError
            If the branch is unknown, there are not as many values as states, or the loop turned at
            a preload, which lies between load steps.
        """
        if self.preload is not None:
            raise ValueError(
                "this loop turned at a preload, between two load steps: take its values with at"
            )
        values = self._of_states(values)
        chosen = self.states(branch, load_steps_only=True)
        control, h_max = self.problem.control, self.problem.profile.h_max
        prescribed = control.prescribed(self.separation[chosen], self.mean_stress[chosen])
        unit = self.turning_point / self.load_steps * (1.0 if control.is_load else h_max)
        index = np.abs(np.rint((prescribed[0] - prescribed) / unit)) if len(chosen) else np.empty(0)
        if branch == "loading" or len(chosen) < 2 or index[-1] == len(chosen) - 1:
            return values[chosen]
        # under a load the last state lies where contact was lost, off the axis
        return np.interp(np.arange(min(index[-1] + 1, most)), index, values[chosen])

    def at(self, branch: Branch, drives: Array, values: Array) -> Array:
        """Interpolate values of one branch linearly between its states.

        Parameters
        ----------
        branch : {"loading", "unloading"}
        drives : array, shape (points,)
            Δ/h_max at fixed separation, u_tot/h_max for a stiffness; Δ/h_max under a load, too,
            where jumps are sloped lines.
        values : array, shape (states,)

        Returns
        -------
        array, shape (points,)
            At a jump the value after it; 0 out of contact; NaN beyond the turning point.

        Raises
        ------
        ValueError
            If the branch is unknown, or there are not as many values as states.
        """
        values, drives = self._of_states(values), reals("drives", drives)
        chosen = self.states(branch)
        control, h_max = self.problem.control, self.problem.profile.h_max
        control = Control() if control.is_load else control
        x = control.prescribed(self.separation[chosen], self.mean_stress[chosen])
        wanted = h_max * (1.0 - drives)
        sign = -1.0 if branch == "loading" else 1.0  # of the change of x along the branch
        x, wanted = sign * x, sign * wanted
        turn = x[-1] if branch == "loading" else x[0]
        near = 1e-12 * h_max
        beyond = wanted > turn + near if branch == "loading" else wanted < turn - near
        left, right = (0.0, None) if branch == "loading" else (None, 0.0)
        found = np.interp(wanted, x, values[chosen].astype(float), left, right)
        return np.where(beyond, np.nan, found)

    def at_stress(self, stress: float, branch: Branch = "unloading") -> LoopState:
        """Compute the state of a branch at a mean stress, with its contact, gaps and fields.

        Parameters
        ----------
        stress : float
            p̄ in Pa, compression positive.
        branch : {"loading", "unloading"}

        Returns
        -------
        LoopState
            The first state in contact with that mean stress; where only jumps pass it, the end of
            the first of them.

        Raises
        ------
        ValueError
            If no state of the branch has that mean stress, the branch is unknown, or the loop
            comes from a file and holds no contact states.
        TypeError
            If the stress is not a number.

        References
        ----------
        docs/preload.md, "Contact and gaps at a mean stress"

        Examples
        --------
        >>> from adhesis import HalfSpace, Problem, make_method, run_loop, single_wave
        >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.001)
        >>> loop = run_loop(make_method("sharp", problem), preload=500, load_steps=8)
        >>> state = loop.at_stress(100, "unloading")
        >>> round(state.mean_stress, 3), state.fields().gap.shape
        (100.0, (32,))
        """
        stress, chosen = real("stress", stress, STRESS), self.states(branch)
        if self.new_method is None or not self.contact_states:
            raise ValueError(
                "this loop holds no contact states: it was loaded from a file; run it again, or "
                "ask before it is saved"
            )
        return state_at_stress(self, self.new_method(), branch, chosen, stress)

    def states(self, branch: Branch, load_steps_only: bool = False) -> NDArray[np.intp]:
        """Return the indices of one branch's states, optionally only those on the load-step axis.

        Raises
        ------
        ValueError
            If the branch is neither "loading" nor "unloading".
        """
        choice("branch", branch, BRANCHES)
        chosen = self.branch == branch
        return np.flatnonzero(chosen & self.load_step if load_steps_only else chosen)

    def _of_states(self, values: Array) -> Array:
        """Return values as an array; raise unless there is one for each state."""
        array = np.asarray(values)
        if array.shape != self.separation.shape:
            raise ValueError(
                f"values have the shape {array.shape}: there must be one for each of the "
                f"{len(self.separation)} states"
            )
        return array


def result_of(
    record: Record,
    turning_point: float,
    load_steps: int,
    started: float,
    preload: float | None = None,
) -> LoopResult:
    """Make the result from the record of a loop; ``started`` is its first CPU time, in s.

    Raises
    ------
    PathError
        If the error of the loss is as large as the loss, or surfaces overlap where nothing touches.
    """
    problem = record.problem
    fields, ledger = path_fields(record, started)
    loss, error = ledger.work, fields["loss_error"]
    if problem.work_of_adhesion > 0 and not error < abs(loss):
        raise PathError(
            f"the loss is not resolved: {loss:.3g} J/m² with a numerical error of {error:.2g} "
            f"J/m², as large as itself; a finer accuracy, more nodes{problem.or_other_method} may "
            "resolve it"
        )
    turn = record.branches.index("unloading")  # the turning point's state stands in both branches
    max_penetration = turning_point
    if not problem.control.is_fixed:
        max_penetration = float(fields["penetration"][turn])
    gained = -math.fsum(ledger.part(0, turn).displaced)
    result = LoopResult(
        turning_point=turning_point,
        max_penetration=max_penetration,
        preload=preload,
        load_steps=load_steps,
        loss=loss,
        loss_dimensionless=loss / problem.loss_scale,
        work_gained=gained,
        work_spent=loss + gained,
        **fields,
    )
    return with_turn_range(result, record, started)
