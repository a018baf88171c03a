"""Run several loops that share one loading branch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import process_time

from adhesis.solver.checks import instance, row
from adhesis.solver.loading.loop import (
    HOW_METHOD,
    Progress,
    check_cycle,
    progress_of,
    turning_of,
    unload_recorded,
)
from adhesis.solver.loading.loop_result import LoopResult, result_of
from adhesis.solver.loading.path_record import Axis, Record
from adhesis.solver.method import ContactState, Method, PathError
from adhesis.solver.model.jump import Branch


class LoadingBranch:
    """Loading branch that is followed on demand, with loops that unload from its turning points.

    A loop depends on the turning points and marks of the branch, but not on which of them are used,
    nor on earlier computations.

    Parameters
    ----------
    method : Method
    turning_points : sequence of float, shape (loops,)
        Different ones: Δ/h_max or u_tot/h_max, or p̄ in Pa under a load.
    load_steps : int
        Equal steps up to the largest turning point; unloading branches use the same step.
    marks : sequence of float
        Further values at which a step of the loading branch ends.

    Raises
    ------
    ValueError
        If a cycle cannot be run (:func:`adhesis.solver.loading.loop.check_cycle`), or a turning
        point is given twice, or none.
    TypeError
        If the method is not a Method, or a value not a number.

    References
    ----------
    docs/theory.md, "8. Paths and controls"
    """

    def __init__(
        self,
        method: Method,
        turning_points: Sequence[float],
        *,
        load_steps: int,
        marks: Sequence[float] = (),
    ) -> None:
        instance("method", method, Method, HOW_METHOD)
        points = row("turning points", turning_points, entry="turning point").tolist()
        turns = sorted(points)
        if not turns or len(set(turns)) < len(turns):
            raise ValueError(f"turning points are {points}: there must be some, all different")
        for turn in turns:
            _, load_steps = check_cycle(turn, load_steps, method.problem.control)
        self.method = method
        self._axis = Axis(turns[-1], load_steps)
        further = self._axis.apart(marks, turns)
        self._drives = self._axis.between(0.0, turns[-1], [*turns, *further])
        self._turns = frozenset(turns)
        self._passed = 0  # number of prescribed values reached
        self._record = Record()
        self._state = method.detached(method.problem.profile.h_max)
        self._record.visit("loading", False, self._state)
        self._seconds = 0.0
        self._error: PathError | None = None

    def advance_to(self, turn: float, progress: Progress | None = None) -> None:
        """Follow the branch to a turning point, unless it is already there or beyond.

        Raises
        ------
        ValueError
            If ``turn`` is not one of its turning points.
        PathError
            If the branch cannot be followed so far; at every further call, too.
        """
        if turn not in self._turns:
            raise ValueError(f"{turn!r} is not a turning point of this loading branch")
        started = process_time()
        problem = self.method.problem
        while self._passed < len(self._drives) and self._drives[self._passed] <= turn:
            if self._error is not None:
                raise self._error
            drive = self._drives[self._passed]
            try:
                path = self.method.follow(self._state, problem.prescribed(drive))
            except PathError as error:
                self._error = error
                raise
            if progress is not None:
                progress("loading", drive, path.states[-1])
            self._state = self._record.extend("loading", path)
            self._passed += 1
        self._seconds += process_time() - started

    def loop(
        self,
        turn: float,
        *,
        marks: Sequence[float] = (),
        progress: Progress | None = None,
        on_state: Callable[[Branch, ContactState], None] | None = None,
    ) -> LoopResult:
        """Follow the branch to a turning point not yet passed, and unload from there.

        Parameters
        ----------
        turn : float
        marks : sequence of float
            Further values at which a step of the unloading branch ends.
        progress : callable, optional
            See :data:`adhesis.solver.loading.loop.Progress`.
        on_state : callable, optional
            Called with every state of the loop, in order, those of the loading branch too.

        Returns
        -------
        LoopResult
            As in :func:`run_loops`.

        Raises
        ------
        ValueError
            If ``turn`` is not one of its turning points, or is already passed.
        PathError
            As in :func:`adhesis.solver.loading.loop.run_loop`.
        """
        self.advance_to(turn, progress)
        if self._drives[self._passed - 1] != turn:
            raise ValueError(f"this loading branch has passed {turn!r}")
        started = process_time() - self._seconds
        record = self._record.copy()
        record.on_state = on_state
        if on_state is not None:
            for branch, state in zip(record.branches, record.states, strict=True):
                on_state(branch, state)
        axis = self._axis
        apart = axis.apart(marks)
        unload_recorded(self.method, record, self._state, axis, turn, progress, apart)
        return result_of(self.method, record, turn, self._passed - 1, started)


def run_loops(
    method: Method,
    *,
    max_penetration: Sequence[float] | None = None,
    max_stress: Sequence[float] | None = None,
    load_steps: int,
    progress: Progress | bool | None = None,
) -> tuple[LoopResult, ...]:
    """Run loops that share one loading branch, which is followed once.

    Parameters
    ----------
    method : Method
    max_penetration, max_stress : sequence of float, shape (loops,)
        The turning points, all different: Δ/h_max or u_tot/h_max, or Pa under a load. May be any
        iterable of numbers.
    load_steps : int
        Equal steps up to the largest turning point; unloading branches use the same step.
    progress : callable or bool, optional
        True shows a bar, in a terminal or notebook; a function is called as
        :data:`adhesis.solver.loading.loop.Progress` says.

    Returns
    -------
    tuple of LoopResult
        One per turning point, in the given order. ``load_steps`` counts those of the loop's part of
        the loading branch, ``seconds`` the CPU time of that part and of unloading.

    Raises
    ------
    ValueError
        If a cycle cannot be run (:func:`adhesis.solver.loading.loop.check_cycle`), or a turning
        point is given twice, or none.
    TypeError
        If the method is not a Method, or a value not a number.
    PathError
        As in :func:`adhesis.solver.loading.loop.run_loop`.

    References
    ----------
    docs/theory.md, "8. Paths and controls"
    """
    instance("method", method, Method, HOW_METHOD)
    name = "max_stress" if method.problem.control.is_load else "max_penetration"
    given = turning_of(method.problem, max_penetration, max_stress)
    points = row(name, given, entry="turning point").tolist()
    branch = LoadingBranch(method, points, load_steps=load_steps)
    with progress_of(progress, max(points)) as report:
        loops = {turn: branch.loop(turn, progress=report) for turn in sorted(points)}
    return tuple(loops[turn] for turn in points)
