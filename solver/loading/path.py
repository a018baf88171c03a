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

from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.checks import counted, finite_row, flag, function, instance
from adhesis.solver.loading.cycle import DEFAULT_LOAD_STEPS, check_cycle
from adhesis.solver.loading.equilibrium_path import EquilibriumPath, path_fields, with_turn_range
from adhesis.solver.loading.ledger import Ledger
from adhesis.solver.loading.mean_stress_event import before_jumps
from adhesis.solver.loading.path_record import (
    HOW_METHOD,
    Axis,
    OnState,
    Progress,
    Record,
    progress_of,
)
from adhesis.solver.method import Method, PathError
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
        ranges on the loop, or contact to 1e-9 of the largest one.

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

    def __str__(self) -> str:
        end = (
            "comes back to the same state"
            if self.closes
            else f"ends {self.stress_change:+.3g} Pa and {self.contact_change:+.3g} A/A0 away"
        )
        return (
            f"{self.start:g}, {self.turn:g}, {self.start:g}: {self.loss:.6g} J/m² "
            f"(drops {self.loss_from_drops:.6g}), {end}"
        )


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

    _result = "work"
    _columns = ("potential", "leg")
    _numbers = ("loss", "loss_dimensionless", "energy_change")

    def __repr__(self) -> str:
        """Return two lines with the path and its work."""
        points = ", ".join(map(str, self.turning_points[:_SHOWN]))
        points += ", …" if len(self.turning_points) > _SHOWN else ""
        return (
            f"PathResult({points}{', out' if self.ends_out else ''}; {self.load_steps} load steps, "
            f"{len(self.separation)} states, method {self.method.name!r},\n"
            f"  work={self.work:.6g} J/m², loss_error={self.loss_error:.2g} J/m², "
            f"least_range={self.least_range:.3g} m, {counted(len(self.jumps), 'jump')}, "
            f"{counted(len(self.minor_loops), 'minor loop')})"
        )

    def _rows_of_way(self, contact: str) -> list[tuple[str, str]]:
        way = ", ".join([*map(str, self.turning_points), *(["out"] if self.ends_out else [])])
        share, note = self._share_and_note(self.work)
        stored = f"of which {self.energy_change:.6g} J/m² are stored"
        return [
            ("path", f"{way} in {self.load_steps} load steps to the largest; {contact}"),
            ("work", f"{self.work:.6g} J/m²{share}, {stored}{note}"),
        ]

    def _rows_of_end(self) -> list[tuple[str, str]]:
        return [("minor loop", str(part)) for part in self.minor_loops]

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
        scale = self.scale_of_errors
        rest = self.work - self.energy_change - self.loss_from_drops
        return rest / scale if scale else 0.0

    @property
    def scale_of_errors(self) -> float:
        """The largest of work, change of energy and sum of drops, each without its sign."""
        return max(abs(self.work), abs(self.energy_change), abs(self.loss_from_drops))


def check_path(
    turning_points: Sequence[float], load_steps: int, problem: Problem, out: bool = False
) -> tuple[float, ...]:
    """Check a path, which ends out of contact if ``out``, and return its turning points.

    Raises
    ------
    ValueError
        Unless it starts with loading and turns at every point (at the last one too, if it ends out
        of contact), and the largest turning point could be that of a loop
        (:func:`adhesis.solver.loading.cycle.check_cycle`).
    TypeError
        If one of them, or load_steps, is not a number.
    """
    found = finite_row("turning_points", turning_points, entry="turning point")
    points: tuple[float, ...] = tuple(found.tolist())
    if not points:
        raise ValueError("a path needs at least one turning point")
    if points[0] <= 0:
        raise ValueError(
            f"the path starts with {points[0]}: it must start with loading, to a turning point "
            "above 0"
        )
    for i in range(1, len(points)):
        falls = points[i] < points[i - 1]
        if falls != (i % 2 == 1) or points[i] == points[i - 1]:
            raise ValueError(
                f"the path goes from {points[i - 1]} to {points[i]}: after "
                f"{'loading it must unload' if i % 2 else 'unloading it must load'}"
            )
    if out and len(points) % 2 == 0:
        raise ValueError(
            f"the path ends with unloading to {points[-1]} and goes out: omit that turning point"
        )
    check_cycle(max(points), load_steps, problem.control, "turning_points")
    return points


def run_path(
    method: Method,
    turning_points: Sequence[float],
    *,
    load_steps: int = DEFAULT_LOAD_STEPS,
    out: bool = True,
    progress: Progress | bool | None = None,
    on_state: OnState | None = None,
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

    Examples
    --------
    >>> from adhesis import HalfSpace, Problem, make_method, run_path, single_wave
    >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
    >>> path = run_path(make_method("sharp", problem), [0.6, 0.2, 0.4], load_steps=6)
    >>> path.minor_loops[0].closes  # a wave does not jump between first touch and pull-off
    True
    """
    instance("method", method, Method, HOW_METHOD)
    points = check_path(turning_points, load_steps, method.problem, flag("out", out))
    load_steps = int(load_steps)
    function("on_state", on_state)
    started = process_time()
    with progress_of(progress, max(points), method.problem.control) as report:
        record = _PathRecord(method, Axis(max(points), load_steps))
        record.on_state, record.progress = on_state, report
        for point in points:
            record.follow_leg(point)
        if out:
            record.unload([turn.drive for turn in record.open_turns])
    return record.result(points, load_steps, started)


@dataclass
class _Turn:
    """A turning point that a later leg may come back to, with the index of its state."""

    drive: float
    state: int


class _PathRecord(Record):
    """Record of a path that notes the minor loops as they close."""

    def __init__(self, method: Method, axis: Axis) -> None:
        super().__init__(method, axis)
        self.open_turns: list[_Turn] = []
        self.closed: list[tuple[_Turn, _Turn, int]] = []  # start, turn, number of states at the end

    def begin(self, branch: Branch) -> None:
        """Begin a leg at a turning point, which a later leg may come back to."""
        if self.states:
            self.open_turns.append(_Turn(self.drive, len(self.states)))
        super().begin(branch)

    def follow_leg(self, point: float) -> None:
        """Follow one leg, to the turning point ``point``."""
        marks = [turn.drive for turn in self.open_turns]
        drives = self.axis.between(self.drive, point, marks)
        self.begin("loading" if point > self.drive or not self.states else "unloading")
        for drive in drives[1:] if self.leg else drives:  # the first leg begins with first touch
            self.step(drive)
            if not self.state.patches and self.leg > 0:
                unit = "Pa" if self.problem.control.is_load else "h_max"
                where = self.problem.describe_prescribed(self.problem.prescribed(drive))
                raise PathError(
                    f"contact is lost on the way to {point:g} {unit}, at {where}, before the path "
                    "has ended: choose a turning point at which contact lasts, or end the path "
                    "with out"
                )

    def step(self, drive: float, preload: float | None = None) -> bool:
        """Follow one load step, and note the minor loops that it closes."""
        reached = super().step(drive, preload)
        while len(self.open_turns) > 1 and drive == self.open_turns[-2].drive:
            self.closed.append((self.open_turns[-2], self.open_turns[-1], len(self.states)))
            del self.open_turns[-2:]
        return reached

    def result(self, points: tuple[float, ...], load_steps: int, started: float) -> PathResult:
        """Make the result of the path."""
        fields, ledger = path_fields(self, started)
        legs = np.array(self.legs)
        result = PathResult(
            turning_points=points,
            load_steps=load_steps,
            leg=legs,
            potential=self.column("potential"),
            jump_leg=legs[before_jumps(self.states, self.jumps)],
            minor_loops=tuple(self._minor_loop(ledger, *ends) for ends in self.closed),
            work=ledger.work,
            energy_change=ledger.rise,
            **fields,
        )
        return with_turn_range(result, self, started)

    def _minor_loop(self, ledger: Ledger, start: _Turn, turn: _Turn, stop: int) -> MinorLoop:
        part = ledger.part(start.state, stop)
        stress, contact = (
            self.column(name)[start.state : stop] for name in ("mean_stress", "contact_fraction")
        )
        stress_change = float(stress[-1] - stress[0])
        contact_change = float(contact[-1] - contact[0])
        same_contact = max(_SAME * np.ptp(contact), _ROUNDING * contact.max())
        return MinorLoop(
            start=start.drive,
            turn=turn.drive,
            branch="loading" if turn.drive > start.drive else "unloading",
            loss=part.work,
            loss_from_drops=part.loss,
            energy_change=part.rise,
            stress_change=stress_change,
            contact_change=contact_change,
            closes=bool(
                abs(stress_change) <= _SAME * np.ptp(stress) and abs(contact_change) <= same_contact
            ),
        )
