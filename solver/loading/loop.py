"""Run complete loading-unloading loops, several of them on one loading branch."""

from __future__ import annotations

from collections.abc import Sequence
from time import process_time

from adhesis.solver.checks import function, instance, real, row
from adhesis.solver.loading.cycle import DEFAULT_LOAD_STEPS, check_cycle, latest_turn, turning_of
from adhesis.solver.loading.loop_result import LoopResult, result_of
from adhesis.solver.loading.mean_stress_event import has_reached
from adhesis.solver.loading.path_record import (
    HOW_METHOD,
    Axis,
    OnState,
    Progress,
    Record,
    progress_of,
)
from adhesis.solver.method import Method


def run_loop(
    method: Method,
    *,
    max_penetration: float | None = None,
    max_stress: float | None = None,
    preload: float | None = None,
    load_steps: int = DEFAULT_LOAD_STEPS,
    progress: Progress | bool | None = None,
    on_state: OnState | None = None,
) -> LoopResult:
    """Load from first touch to the turning point, then unload until detached.

    Parameters
    ----------
    method : Method
    max_penetration : float
        Δ~max = Δ/h_max, 0 < Δ~max < 1; u_tot/h_max if the control is a stiffness. With a preload it
        is where the path turns at the latest (by default 0.999; with a stiffness no limit).
    max_stress : float
        Instead, under a load: p̄ in Pa, positive.
    preload : float
        Instead, at a fixed separation or with a stiffness: p̄ in Pa, positive. The path turns in the
        first state whose mean stress is at least that.
    load_steps : int
        Equal steps of the loading branch, with a preload up to the latest turning point; unloading
        uses the same step.
    progress : callable or bool, optional
        True shows a bar on a terminal, and lines elsewhere; a function is called as
        :data:`adhesis.solver.loading.path_record.Progress` says.
    on_state : callable, optional
        Called with every state of the path, in order (for fields at chosen penetrations).

    Raises
    ------
    ValueError
        If the cycle cannot be run (:func:`adhesis.solver.loading.cycle.check_cycle`).
    TypeError
        If the method is not a Method, or a value not a number.
    PathError
        If the path cannot be followed, or the contact does not detach.

    References
    ----------
    docs/theory.md, "3. The loop"

    Examples
    --------
    >>> from adhesis import HalfSpace, Problem, make_method, run_loop, single_wave
    >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
    >>> loop = run_loop(make_method("sharp", problem), max_penetration=0.5, load_steps=4)
    >>> round(loop.loss_from_drops / loop.loss, 3)  # jumps lose what the cycle spends
    1.0
    """
    control = instance("method", method, Method, HOW_METHOD).problem.control
    if preload is None:
        turning_point = turning_of(control, max_penetration, max_stress)
    else:
        turning_point = latest_turn(method.problem, preload, max_penetration, max_stress)
    turning_point, load_steps = check_cycle(turning_point, load_steps, control)
    function("on_state", on_state)
    turn, latest = (turning_point, None) if preload is None else (preload, turning_point)
    branch = LoadingBranch(method, [turn], load_steps=load_steps, latest=latest)
    with progress_of(progress, turning_point, control) as report:
        return branch.loop(turn, progress=report, on_state=on_state)


class LoadingBranch:
    """Loading branch that is followed on demand, with loops that unload from its turning points.

    A loop depends on the turning points and marks of the branch, but not on which of them are
    used.

    Parameters
    ----------
    turning_points : sequence of float, shape (loops,)
        Different ones: Δ/h_max or u_tot/h_max, or p̄ in Pa under a load; with ``latest``,
        preloads in Pa.
    load_steps : int
        Equal steps up to the largest turning point, or to ``latest``; unloading branches use the
        same step.
    marks : sequence of float
        Further values at which a step of the loading branch ends.
    latest : float, optional
        Where a loop turns whose preload is not reached: Δ/h_max or u_tot/h_max.

    Raises
    ------
    ValueError, TypeError
        As in :func:`run_loops`.
    """

    def __init__(
        self,
        method: Method,
        turning_points: Sequence[float],
        *,
        load_steps: int,
        marks: Sequence[float] = (),
        latest: float | None = None,
    ) -> None:
        instance("method", method, Method, HOW_METHOD)
        points = row("turning points", turning_points, entry="turning point").tolist()
        turns = sorted(points)
        if not turns or len(set(turns)) < len(turns):
            raise ValueError(f"turning points are {points}: there must be some, all different")
        ends = turns if latest is None else [latest]
        for end in ends:
            _, load_steps = check_cycle(end, load_steps, method.problem.control)
        self.method = method
        axis = Axis(ends[-1], load_steps)
        self._drives = axis.between(0.0, ends[-1], [*ends, *axis.apart(marks, ends)])
        self._turns = turns
        self._ahead = [*turns]  # those not yet left; the state lies at the first, or before it
        self._of_preloads = latest is not None
        self._passed = 0  # number of prescribed values reached
        self._record = Record(method, axis)
        self._record.begin("loading")
        self._reached: list[float] = []  # prescribed values at the ends of steps
        self._seconds = 0.0

    def _advance_to(self, turn: float, progress: Progress | None) -> None:
        """Follow the branch to the next of its turning points, unless it is there."""
        preload = turn if self._of_preloads else None
        self._record.progress = progress
        while not self._is_at(turn):
            self._passed += not self._record.step(self._drives[self._passed], preload)
            self._reached.append(self._record.drive)

    def _is_at(self, turn: float) -> bool:
        """Return whether a turning point is reached, or the branch has ended before a preload."""
        if self._passed == len(self._drives):
            return True
        if not self._of_preloads:
            return self._drives[self._passed] > turn
        return has_reached(self._record.state.mean_stress, turn)

    def loop(
        self,
        turn: float,
        *,
        marks: Sequence[float] = (),
        progress: Progress | None = None,
        on_state: OnState | None = None,
    ) -> LoopResult:
        """Follow the branch to a turning point not yet passed, and unload from there.

        ``marks`` are further values at which a step of the unloading branch ends.

        Raises
        ------
        ValueError
            If ``turn`` is not one of its turning points, or is already passed.
        PathError
            As in :func:`run_loop`.
        """
        if turn not in self._turns:
            raise ValueError(f"{turn!r} is not a turning point of this loading branch")
        if turn not in self._ahead:
            raise ValueError(f"this loading branch has passed {turn!r}")
        started = process_time() - self._seconds
        self._advance_to(self._ahead[0], progress)
        while self._ahead[0] != turn:
            del self._ahead[0]
            self._advance_to(self._ahead[0], progress)
        self._seconds = process_time() - started
        record = self._record.copy()
        record.on_state, record.progress = on_state, progress
        if on_state is not None:
            for branch, state in zip(record.branches, record.states, strict=True):
                on_state(branch, state)
        turned = record.drive
        # without adhesion a loop is reversible: back over the states of loading
        back = [] if record.problem.work_of_adhesion else self._reached
        record.unload(record.axis.apart([*marks, *back]))
        preload = turn if self._of_preloads else None
        ended = self._passed == len(self._drives) or not self._of_preloads
        steps = self._passed - 1 if ended else self._passed
        return result_of(record, turned, steps, started, preload)


def run_loops(
    method: Method,
    *,
    max_penetration: Sequence[float] | float | None = None,
    max_stress: Sequence[float] | None = None,
    preload: Sequence[float] | None = None,
    load_steps: int = DEFAULT_LOAD_STEPS,
    progress: Progress | bool | None = None,
) -> tuple[LoopResult, ...]:
    """Run loops that share one loading branch, which is followed once.

    Parameters
    ----------
    method : Method
    max_penetration, max_stress : sequence of float, shape (loops,)
        The turning points, all different: Δ/h_max or u_tot/h_max, or Pa under a load. May be any
        iterable of numbers.
    preload : sequence of float, shape (loops,)
        Instead, in Pa and all different: each loop turns where its mean stress reaches its preload
        (:func:`run_loop`). ``max_penetration`` is then one number, where it turns at the latest.
    load_steps : int
        Equal steps up to the largest, or latest, turning point; unloading branches use the same
        step.
    progress : callable or bool, optional
        As in :func:`run_loop`.

    Returns
    -------
    tuple of LoopResult
        One per turning point, in the given order. ``load_steps`` counts those of the loop's part of
        the loading branch, ``seconds`` the CPU time of that part and of unloading.

    Raises
    ------
    ValueError
        If a cycle cannot be run (:func:`adhesis.solver.loading.cycle.check_cycle`), or a turning
        point is given twice, or none.
    TypeError
        If the method is not a Method, or a value not a number.
    PathError
        As in :func:`run_loop`.

    References
    ----------
    docs/theory.md, "8. Paths and controls"

    Examples
    --------
    >>> from adhesis import HalfSpace, Problem, make_method, run_loops, single_wave
    >>> problem = Problem(single_wave(1e-6, 1e-3), HalfSpace(1e6, 0.5), 0.01)
    >>> loops = run_loops(make_method("sharp", problem), max_penetration=[0.3, 0.6], load_steps=4)
    >>> round(loops[1].loss / loops[0].loss, 3)  # beyond first touch a wave does not jump
    1.0
    """
    instance("method", method, Method, HOW_METHOD)
    problem, latest = method.problem, None
    if preload is None:
        name = "max_stress" if problem.control.is_load else "max_penetration"
        given = turning_of(problem.control, max_penetration, max_stress)
        points = row(name, given, entry="turning point").tolist()
    else:
        points = row("preload", preload, entry="preload").tolist()
        one = None if max_penetration is None else real("max_penetration", max_penetration)
        wanted = [latest_turn(problem, point, one, max_stress) for point in points]
        latest = max(wanted, default=None)
    branch = LoadingBranch(method, points, load_steps=load_steps, latest=latest)
    top = max(points) if latest is None else latest
    with progress_of(progress, top, method.problem.control) as report:
        loops = {turn: branch.loop(turn, progress=report) for turn in sorted(points)}
    return tuple(loops[turn] for turn in points)
