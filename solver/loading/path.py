"""Loading paths with several turning points, and the minor loops that they close.

A path starts at first touch, goes from one turning point to the next, loading and unloading in
turn, and ends at the last one or out of contact. A leg that comes back to the start of the previous
leg closes a minor loop. Whether the state is then the earlier one (return-point memory) is not
assumed but measured, and every part is audited,

    -∫ Y dx = ΔW/λ + sum of the drops,

with ΔW the change of the potential from its start to its end (:mod:`adhesis.solver.model.control`),
0 for a part that closes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import process_time

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.checks import counted, finite_row, flag, function, instance
from adhesis.solver.loading.loop import HOW_METHOD, Progress, check_cycle, progress_of, unload
from adhesis.solver.loading.loop_result import estimated_error
from adhesis.solver.loading.path_record import Axis, Record
from adhesis.solver.loading.zero_range import (
    InteriorTension,
    edge_range,
    interior_tension,
    narrowest_length,
    opening_warnings,
    range_warnings,
    valid_range,
)
from adhesis.solver.method import ContactState, Method, MethodReport, PathError
from adhesis.solver.model.jump import Branch, Jump
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Array
from adhesis.solver.values import ByValue
from adhesis.solver.views import Viewed

_SHOWN = 6  # turning points of a path in its repr
_SAME = 1e-6  # least change of stress or contact, relative to its range on the loop, that counts


@dataclass(frozen=True)
class MinorLoop:
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
        Sum of the energy drops at its jumps, in J/m².
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


@dataclass(frozen=True, eq=False, repr=False)
class PathResult(ByValue, Viewed):
    """A path of several legs; arrays have the shape (states,), in the order of the path.

    Immutable; two paths are equal if all fields except ``seconds``, ``method``, ``contact_states``
    and ``new_method`` are.

    Attributes
    ----------
    problem : Problem
    turning_points : tuple of float
        Ends of the legs: Δ/h_max, u_tot/h_max if the control is a stiffness, p̄ in Pa under a load.
        A path that ends out of contact has one more leg.
    load_steps : int
        Equal steps up to the largest turning point.
    leg : int array
        Number of the leg, from 0.
    branch : array of str
        "loading" or "unloading".
    load_step : bool array
        True at load steps and at turning points.
    penetration, separation, mean_stress, contact_fraction : array
        Δ/h_max, s in m, p̄ in Pa, A/A0.
    patches : int array
    elastic_energy, adhesion_energy, potential : array
        In J/m, per period; the potential is W of :mod:`adhesis.solver.model.control`.
    jumps : tuple of Jump
    jump_leg : int array, shape (jumps,)
    minor_loops : tuple of MinorLoop
        In the order in which they end.
    work : float
        -∫ Y dx over the whole path, in J/m² of nominal area: the loss if it ends out of contact.
    loss_from_drops : float
        Sum of all energy drops, in J/m².
    energy_change : float
        (W at the end - W at the start) per nominal area, in J/m²; 0 for a path that ends out of
        contact.
    loss_error : float
        Estimated numerical error of the work, in J/m².
    seconds : float
        CPU time of this process, in s.
    method : MethodReport
    contact_states : tuple of ContactState
        The states themselves, with the edges of every patch; empty for a path from a file.
    new_method : callable or None
        Builds the method anew, whose ``fields`` and ``openings`` take these states.
    interior : InteriorTension or None
        Largest local maximum of tension inside patches, and where it occurred; None if no patch
        has one (docs/zero-range.md).
    narrowest_length : float
        Shortest length in m that decides where edges stand (``zero_range``).

    References
    ----------
    docs/theory.md, "8. Paths and controls"
    """

    problem: Problem = field(repr=False)
    turning_points: tuple[float, ...]
    load_steps: int
    leg: NDArray[np.int64]
    branch: NDArray[np.str_]
    load_step: NDArray[np.bool_]
    penetration: Array
    separation: Array
    mean_stress: Array
    contact_fraction: Array
    patches: NDArray[np.int64]
    elastic_energy: Array
    adhesion_energy: Array
    potential: Array
    jumps: tuple[Jump, ...]
    jump_leg: NDArray[np.int64]
    minor_loops: tuple[MinorLoop, ...]
    work: float
    loss_from_drops: float
    energy_change: float
    loss_error: float
    seconds: float = field(compare=False)
    method: MethodReport = field(compare=False)
    contact_states: tuple[ContactState, ...] = field(default=(), compare=False)
    new_method: Callable[[], Method] | None = field(default=None, compare=False)
    interior: InteriorTension | None = None
    narrowest_length: float = float("nan")

    def __repr__(self) -> str:
        """Return two lines with the path and its work."""
        points = ", ".join(f"{point:g}" for point in self.turning_points[:_SHOWN])
        points += ", …" if len(self.turning_points) > _SHOWN else ""
        return (
            f"PathResult({points}{', out' if self.ends_out else ''}; {self.load_steps} load steps, "
            f"{len(self.separation)} states, method {self.method.name!r},\n"
            f"  work={self.work:.6g} J/m², loss_error={self.loss_error:.2g} J/m², "
            f"valid_range={self.valid_range:.3g} m, {counted(len(self.jumps), 'jump')}, "
            f"{counted(len(self.minor_loops), 'minor loop')})"
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on what makes the work doubtful; none for most paths."""
        lost = self.loss_from_drops
        found = range_warnings(self.problem, self.valid_range, lost, self.contact_fraction)
        return (*found, *opening_warnings(self.jumps, lost))

    @property
    def largest_interior_tension(self) -> float:
        """Largest local maximum of tension inside patches, in Pa; 0 if there is none."""
        return self.interior.tension if self.interior is not None else 0.0

    @property
    def valid_range(self) -> float:
        """Range of adhesion in m below which the zero-range limit holds, γ/σ_in.

        Infinite if no patch is in tension inside (docs/zero-range.md).
        """
        return valid_range(self.problem, self.interior)

    @property
    def edge_range(self) -> float:
        """Range of adhesion in m whose cohesive zone at an edge is ``narrowest_length`` long."""
        return edge_range(self.problem, self.narrowest_length)

    @property
    def openings(self) -> int:
        """Number of jumps that begin with a gap that opens inside a patch."""
        return sum(jump.kind == "opening" for jump in self.jumps)

    @property
    def barrier(self) -> float:
        """Sum of the barriers of these openings, in J/m² (:class:`Jump`)."""
        return float(sum(jump.barrier for jump in self.jumps))

    @property
    def energy(self) -> Array:
        """U in J/m, per period, shape (states,)."""
        return self.elastic_energy + self.adhesion_energy

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
    turning_points: Sequence[float], load_steps: int, problem: Problem
) -> tuple[float, ...]:
    """Check a path and return its turning points.

    Raises
    ------
    ValueError
        Unless it starts with loading and turns at every point, and the largest turning point could
        be that of a loop (:func:`adhesis.solver.loading.loop.check_cycle`).
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
    check_cycle(max(points), load_steps, problem.control)
    return points


def run_path(
    method: Method,
    turning_points: Sequence[float],
    *,
    load_steps: int,
    out: bool = True,
    progress: Progress | bool | None = None,
    on_state: Callable[[Branch, ContactState], None] | None = None,
) -> PathResult:
    """Follow a path from first touch through the turning points, and out of contact.

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
    points = check_path(turning_points, load_steps, method.problem)
    load_steps = int(load_steps)
    function("on_state", on_state)
    if flag("out", out) and len(points) % 2 == 0:
        raise ValueError(
            f"the path ends with unloading to {points[-1]:g} and goes out: omit that turning point"
        )
    started = process_time()
    with progress_of(progress, max(points)) as report:
        runner = _PathRunner(method, Axis(max(points), load_steps), Record(on_state), report)
        for point in points:
            runner.to(point)
        if out:
            runner.out()
    return runner.result(points, load_steps, started)


@dataclass
class _Turn:
    """A turning point that a later leg may come back to, with the index of its state."""

    drive: float
    state: int


class _PathRunner:
    """State of a path while it is followed."""

    def __init__(
        self, method: Method, axis: Axis, record: Record, progress: Progress | None
    ) -> None:
        self.method, self.problem = method, method.problem
        self.axis, self.record, self.progress = axis, record, progress
        self.legs: list[int] = []  # of the states
        self.jump_legs: list[int] = []
        self.jump_steps: list[int] = []  # for each jump, the states before its load step
        self.minor: list[MinorLoop] = []
        self.open: list[_Turn] = []
        self.leg = -1
        self.drive = 0.0
        self.state = method.detached(method.problem.profile.h_max)

    def to(self, point: float) -> None:
        """Follow one leg."""
        branch: Branch = "loading" if point > self.drive or self.leg < 0 else "unloading"
        self._begin(branch)
        marks = [turn.drive for turn in self.open]
        drives = self.axis.between(self.drive, point, marks)
        for drive in drives[1:] if self.leg else drives:  # the first leg begins with first touch
            self._step(branch, drive)
            if not self.state.patches and self.leg > 0:
                unit = "Pa" if self.problem.control.is_load else "h_max"
                raise PathError(
                    f"contact is lost on the way to {point:g} {unit}, at "
                    f"{self.problem.place(self.problem.prescribed(drive))}, before the path has "
                    "ended: choose a turning point at which contact lasts, or end the path with out"
                )
        self.drive = point

    def out(self) -> None:
        """Unload until contact is lost, as a loop does."""
        self._begin("unloading")
        marks = [turn.drive for turn in self.open[:-1]]
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
            self.open.append(_Turn(self.drive, len(self.record.states)))
        self.record.visit(branch, self.leg > 0, self.state)
        self.legs.append(self.leg)

    def _step(self, branch: Branch, drive: float) -> ContactState:
        path = self.method.follow(self.state, self.problem.prescribed(drive))
        self.jump_steps += [len(self.record.states)] * len(path.jumps)
        self.jump_legs += [self.leg] * len(path.jumps)
        self.state = self.record.extend(branch, path)
        self.legs += [self.leg] * len(path.states)
        if self.progress is not None:
            self.progress(branch, drive, self.state)
        while len(self.open) > 1 and drive == self.open[-2].drive:
            self._close(self.open[-2], self.open[-1])
            del self.open[-2:]
        return self.state

    def _close(self, start: _Turn, turn: _Turn) -> None:
        """Record the minor loop from ``start`` over ``turn`` to the last state."""
        record, period = self.record, self.problem.profile.period
        part = record.slice(start.state)
        begin, end = part.states[0], part.states[-1]
        drops = sum(
            jump.energy_drop
            for jump, step in zip(record.jumps, self.jump_steps, strict=True)
            if step > start.state
        )
        stress, contact = part.column("mean_stress"), part.column("contact_fraction")
        stress_change = float(stress[-1] - stress[0])
        contact_change = float(contact[-1] - contact[0])
        self.minor.append(
            MinorLoop(
                start=start.drive,
                turn=turn.drive,
                branch="loading" if turn.drive > start.drive else "unloading",
                loss=part.work(self.problem),
                loss_from_drops=float(drops),
                energy_change=(end.potential - begin.potential) / period,
                stress_change=stress_change,
                contact_change=contact_change,
                closes=bool(
                    abs(stress_change) <= _SAME * np.ptp(stress)
                    and abs(contact_change) <= _SAME * np.ptp(contact)
                ),
            )
        )

    def result(self, points: tuple[float, ...], load_steps: int, started: float) -> PathResult:
        """Make the result of the path."""
        record, problem = self.record, self.problem
        work = record.work(problem)
        drops = float(sum(jump.energy_drop for jump in record.jumps))
        states = record.states
        report = self.method.report()  # of the path alone
        interior = interior_tension(self.method, record)
        change = (states[-1].potential - states[0].potential) / problem.profile.period
        separation = record.column("separation")
        return PathResult(
            problem=problem,
            turning_points=points,
            load_steps=load_steps,
            leg=np.array(self.legs),
            branch=np.array(record.branches),
            load_step=np.array(record.on_axis),
            penetration=problem.penetration(separation),
            separation=separation,
            mean_stress=record.column("mean_stress"),
            contact_fraction=record.column("contact_fraction"),
            patches=record.column("patches").astype(np.int64),
            elastic_energy=record.column("elastic_energy"),
            adhesion_energy=record.column("adhesion_energy"),
            potential=record.column("potential"),
            jumps=tuple(record.jumps),
            jump_leg=np.array(self.jump_legs, dtype=np.int64),
            minor_loops=tuple(self.minor),
            work=work,
            loss_from_drops=drops,
            energy_change=change,
            loss_error=estimated_error(record, work - change - drops, problem),
            seconds=process_time() - started,
            method=report,
            contact_states=tuple(states),
            new_method=self.method.recipe,
            interior=interior,
            narrowest_length=narrowest_length(problem, record),
        )
