"""Follow loading paths with several turning points, and the minor loops that they close.

A path starts at first touch, goes from one turning point to the next, loading and unloading in
turn, and ends at the last one or out of contact. A leg that comes back to the start of the previous
leg closes a minor loop. Whether the state is then the earlier one (return-point memory) is not
assumed but measured, and every part is audited,

    -∫ Y dx = ΔW/λ + sum of the drops + friction of edges between jumps,

with ΔW the change of the potential from its start to its end (:mod:`adhesis.solver.model.control`),
0 for a part that closes. Edges have friction where two works of adhesion differ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.checks import counted, finite_row, flag, function, instance
from adhesis.solver.loading.equilibrium_path import EquilibriumPath, path_fields, with_turn_range
from adhesis.solver.loading.loop import (
    DEFAULT_LOAD_STEPS,
    HOW_METHOD,
    Progress,
    check_cycle,
    progress_of,
    unload,
)
from adhesis.solver.loading.loop_result import estimated_error, strain_warnings
from adhesis.solver.loading.path_record import Axis, Record
from adhesis.solver.loading.zero_range import opening_warnings, range_warnings
from adhesis.solver.method import ContactState, Method, PathError
from adhesis.solver.model.jump import Branch
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.views import NotebookDisplay

_SHOWN = 6  # turning points of a path in its repr
_SAME = 1e-6  # least change of stress or contact, relative to its range on the loop, that counts
_ROUNDING = 1e-9  # of the largest contact: what it changes by where all edges are pinned


@dataclass(frozen=True)
class MinorLoop(NotebookDisplay):
    """Part of a path that leaves a turning point and comes back to it.

    Attributes
    ----------
    start, turn : float
        The turning point at its start and end, and the one between: Δ/h_max, u_tot/h_max or Pa, as
        in :attr:`PathResult.turning_points`.
    branch : {"loading", "unloading"}
        Of its first leg.
    loss : float
        Work -∫ Y dx, in J/m² of nominal area.
    loss_from_drops : float
        Sum of the energy drops at its jumps, in J/m², and of the friction of edges between them.
    energy_change : float
        (W at its end - W at its start) per nominal area, in J/m²: 0 if it closes.
    stress_change : float
        p̄ at its end less that at its start, in Pa.
    contact_change : float
        A/A0 at its end less that at its start.
    closes : bool
        True if it ends in its initial state: stress and contact agree to a millionth of their
        ranges on the loop.

    References
    ----------
    docs/theory.md, "8. Paths and controls"
    """

    start: float
    turn: float
    branch: Branch
    loss: float
    loss_from_drops: float
    energy_change: float
    stress_change: float
    contact_change: float
    closes: bool

    @property
    def audit_residual(self) -> float:
        """Work less change of energy and drops, in J/m²."""
        return self.loss - self.energy_change - self.loss_from_drops


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PathResult(EquilibriumPath):
    """A path of several legs; arrays have the shape (states,), in the order of the path.

    Its states and jumps are the attributes of :class:`EquilibriumPath`: ``branch``,
    ``penetration``, ``separation``, ``mean_stress``, ``contact_fraction``, ``patches``, ``jumps``,
    ``contact_states`` …

    Attributes
    ----------
    turning_points : tuple of float
        Ends of the legs: Δ/h_max, u_tot/h_max if the control is a stiffness, p̄ in Pa under a load.
        A path that ends out of contact has one more leg.
    leg : int array
        Number of the leg, from 0.
    potential : array
        W of :mod:`adhesis.solver.model.control`, in J/m per period.
    jump_leg : int array, shape (jumps,)
    minor_loops : tuple of MinorLoop
        In the order in which they end.
    work : float
        -∫ Y dx over the whole path, in J/m² of nominal area: the loss if it ends out of contact.
    energy_change : float
        (W at the end - W at the start) per nominal area, in J/m²; 0 for a path that ends out of
        contact.

    References
    ----------
    docs/theory.md, "8. Paths and controls"
    """

    turning_points: tuple[float, ...]
    leg: NDArray[np.int64]
    potential: Array
    jump_leg: NDArray[np.int64]
    minor_loops: tuple[MinorLoop, ...]
    work: float
    energy_change: float

    _columns = ("potential", "leg")
    _numbers = ("loss", "loss_dimensionless", "energy_change")

    def __repr__(self) -> str:
        """Return two lines with the path and its work."""
        points = ", ".join(f"{point:g}" for point in self.turning_points[:_SHOWN])
        points += ", …" if len(self.turning_points) > _SHOWN else ""
        return (
            f"PathResult({points}{', out' if self.ends_out else ''}; {self.load_steps} load steps, "
            f"{len(self.separation)} states, method {self.method.name!r},\n"
            f"  work={self.work:.6g} J/m², loss_error={self.loss_error:.2g} J/m², "
            f"least_range={self.least_range:.3g} m, {counted(len(self.jumps), 'jump')}, "
            f"{counted(len(self.minor_loops), 'minor loop')})"
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Reasons to doubt the work, one sentence each; none for most paths."""
        lost = self.loss_from_drops
        found = range_warnings(
            *(self.problem, self.valid_range, lost, self.contact_fraction),
            *self.outer_ranges,
        )
        found += strain_warnings(self.problem, self.mean_stress, self.separation, self.patches)
        return (*found, *opening_warnings(self.jumps, lost))

    @property
    def loss(self) -> float:
        """The work, which is the loss if the path ends out of contact; in J/m² of nominal area."""
        return self.work

    @property
    def loss_dimensionless(self) -> float:
        """The work in units of E* q0 h_max²/2."""
        return self.work / self.problem.loss_scale

    def jump_rows(self) -> list[dict[str, Any]]:
        """Return the jumps with their penetration and leg, a dictionary for each, in SI units."""
        rows = super().jump_rows()
        return [row | {"leg": int(leg)} for row, leg in zip(rows, self.jump_leg, strict=True)]

    @property
    def ends_out(self) -> bool:
        """True if the path ends out of contact."""
        return bool(self.patches[-1] == 0)

    @property
    def audit_residual(self) -> float:
        """(work - change of energy - sum of drops) / the largest of their absolute values.

        0 if all three are, and without adhesion for a path that ends out of contact, whose work is
        only rounding.
        """
        if self.problem.work_of_adhesion == 0 and self.ends_out:
            return 0.0
        scale = max(abs(self.work), abs(self.energy_change), self.loss_from_drops)
        rest = self.work - self.energy_change - self.loss_from_drops
        return rest / scale if scale else 0.0


def check_path(
    turning_points: Sequence[float], load_steps: int, problem: Problem, out: bool = False
) -> tuple[float, ...]:
    """Check a path, which ends out of contact if ``out``, and return its turning points.

    Raises
    ------
    ValueError
        Unless it starts with loading and turns at every point (at the last one too, if it ends out
        of contact), and the largest turning point could be that of a loop
        (:func:`adhesis.solver.loading.loop.check_cycle`).
    TypeError
        If one of them, or load_steps, is not a number.
    """
    found = finite_row("turning_points", turning_points, entry="turning point")
    points: tuple[float, ...] = tuple(found.tolist())
    if not points:
        raise ValueError("a path needs at least one turning point")
    if points[0] <= 0:
        raise ValueError(
            f"the path starts with {points[0]:g}: it must start with loading, to a turning point "
            "above 0"
        )
    for i in range(1, len(points)):
        falls = points[i] < points[i - 1]
        if falls != (i % 2 == 1) or points[i] == points[i - 1]:
            raise ValueError(
                f"the path goes from {points[i - 1]:g} to {points[i]:g}: after "
                f"{'loading it must unload' if i % 2 else 'unloading it must load'}"
            )
    if out and len(points) % 2 == 0:
        raise ValueError(
            f"the path ends with unloading to {points[-1]:g} and goes out: omit that turning point"
        )
    check_cycle(max(points), load_steps, problem.control)
    return points


def run_path(
    method: Method,
    turning_points: Sequence[float],
    *,
    load_steps: int = DEFAULT_LOAD_STEPS,
    out: bool = True,
    progress: Progress | bool | None = None,
    on_state: Callable[[Branch, ContactState], None] | None = None,
) -> PathResult:
    """Follow a path from first touch through the turning points, and unload until detached.

    Parameters
    ----------
    method : Method
    turning_points : sequence of float, shape (legs,)
        Ends of the legs, loading first: Δ/h_max, u_tot/h_max if the control is a stiffness, p̄ in Pa
        under a load (:mod:`adhesis.solver.model.control`).
    load_steps : int
        Equal steps up to the largest turning point; all legs use the same step.
    out : bool
        Whether to unload after the last turning point until contact is lost. The last leg must
        then be a loading leg.
    progress, on_state : callable, optional
        As in :func:`adhesis.solver.loading.loop.run_loop`.

    Raises
    ------
    ValueError
        If the path cannot be followed (:func:`check_path`).
    TypeError
        If the method is not a Method, or a value not a number.
    PathError
        If the path cannot be followed, or contact is lost before its end.

    References
    ----------
    docs/theory.md, "8. Paths and controls"
    """
    instance("method", method, Method, HOW_METHOD)
    points = check_path(turning_points, load_steps, method.problem, flag("out", out))
    load_steps = int(load_steps)
    function("on_state", on_state)
    started = process_time()
    with progress_of(progress, max(points), method.problem.control) as report:
        runner = _PathRunner(method, Axis(max(points), load_steps), Record(on_state), report)
        for point in points:
            runner.follow_leg(point)
        if out:
            runner.unload()
    return runner.result(points, load_steps, started)


@dataclass
class _OpenTurn:
    """A turning point that a later leg may come back to, with the index of its state.

    ``jumps`` is the number of jumps before it.
    """

    drive: float
    state: int
    jumps: int


class _PathRunner:
    """State of a path while it is followed."""

    def __init__(
        self, method: Method, axis: Axis, record: Record, progress: Progress | None
    ) -> None:
        self.method, self.problem = method, method.problem
        self.axis, self.record, self.progress = axis, record, progress
        self.legs: list[int] = []  # of the states
        self.jump_legs: list[int] = []
        self.minor: list[MinorLoop] = []
        self.open_turns: list[_OpenTurn] = []
        self.leg = -1
        self.drive = 0.0
        self.state = method.detached(method.problem.profile.h_max)

    def follow_leg(self, point: float) -> None:
        """Follow one leg, to the turning point ``point``."""
        branch: Branch = "loading" if point > self.drive or self.leg < 0 else "unloading"
        self._begin(branch)
        marks = [turn.drive for turn in self.open_turns]
        drives = self.axis.between(self.drive, point, marks)
        for drive in drives[1:] if self.leg else drives:  # the first leg begins with first touch
            self._step(branch, drive)
            if not self.state.patches and self.leg > 0:
                unit = "Pa" if self.problem.control.is_load else "h_max"
                where = self.problem.describe_prescribed(self.problem.prescribed(drive))
                raise PathError(
                    f"contact is lost on the way to {point:g} {unit}, at {where}, before the path "
                    "has ended: choose a turning point at which contact lasts, or end the path "
                    "with out"
                )
        self.drive = point

    def unload(self) -> None:
        """Unload until contact is lost, as a loop does."""
        self._begin("unloading")
        marks = [turn.drive for turn in self.open_turns[:-1]]
        unload(
            self.problem,
            self.axis,
            self.drive,
            self.state,
            lambda drive: self._step("unloading", drive),
            marks,
        )

    def _begin(self, branch: Branch) -> None:
        """Start a leg with the state at the turning point, which belongs to both legs."""
        self.leg += 1
        if self.record.states:
            self.open_turns.append(
                _OpenTurn(self.drive, len(self.record.states), len(self.record.jumps))
            )
        self.record.visit(branch, self.leg > 0, self.state)
        self.legs.append(self.leg)

    def _step(self, branch: Branch, drive: float) -> ContactState:
        """Follow one load step, and record the minor loops that it closes."""
        path = self.method.follow(self.state, self.problem.prescribed(drive))
        self.jump_legs += [self.leg] * len(path.jumps)
        self.state = self.record.extend(branch, path)
        self.legs += [self.leg] * len(path.states)
        if self.progress is not None:
            self.progress(branch, drive, self.state)
        while len(self.open_turns) > 1 and drive == self.open_turns[-2].drive:
            self._close(self.open_turns[-2], self.open_turns[-1])
            del self.open_turns[-2:]
        return self.state

    def _close(self, start: _OpenTurn, turn: _OpenTurn) -> None:
        """Record the minor loop from ``start`` over ``turn`` to the last state."""
        record, period = self.record, self.problem.profile.period
        part = record.slice(start.state, jumps=record.jumps[start.jumps :])
        begin, end = part.states[0], part.states[-1]
        stress, contact = part.column("mean_stress"), part.column("contact_fraction")
        stress_change = float(stress[-1] - stress[0])
        contact_change = float(contact[-1] - contact[0])
        self.minor.append(
            MinorLoop(
                start=start.drive,
                turn=turn.drive,
                branch="loading" if turn.drive > start.drive else "unloading",
                loss=part.work(self.problem),
                loss_from_drops=part.dissipated(self.problem),
                energy_change=(end.potential - begin.potential) / period,
                stress_change=stress_change,
                contact_change=contact_change,
                closes=bool(
                    abs(stress_change) <= _SAME * np.ptp(stress)
                    and abs(contact_change)
                    <= max(_SAME * np.ptp(contact), _ROUNDING * contact.max())
                ),
            )
        )

    def result(self, points: tuple[float, ...], load_steps: int, started: float) -> PathResult:
        """Make the result of the path."""
        record, problem = self.record, self.problem
        fields = path_fields(self.method, record, started)
        work, potential = record.work(problem), record.column("potential")
        change = float(potential[-1] - potential[0]) / problem.profile.period
        rest = work - change - fields["loss_from_drops"]
        result = PathResult(
            turning_points=points,
            load_steps=load_steps,
            leg=np.array(self.legs),
            potential=potential,
            jump_leg=np.array(self.jump_legs, dtype=np.int64),
            minor_loops=tuple(self.minor),
            work=work,
            energy_change=change,
            loss_error=estimated_error(record, rest, problem),
            **fields,
        )
        return with_turn_range(result, self.method, record, self.axis.step, started)
