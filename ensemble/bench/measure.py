"""Measure one loop in a process of its own: ``python -m adhesis.ensemble.bench.measure``.

Peak memory belongs to a process, not to a call, and libraries are loaded at their first use. So
every measured loop has a fresh process: it reads a pickled :class:`Run` from its argument, runs a
small loop first, and prints a :class:`Measurement` as JSON.
"""

from __future__ import annotations

import json
import math
import pickle
import resource
import signal
import subprocess
import sys
from dataclasses import asdict, dataclass, replace
from time import process_time

from adhesis.ensemble.bench.scenes import SMALL_ROUGH, Scene
from adhesis.ensemble.run import launch
from adhesis.solver.loading.loop import run_loop
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.registry import MethodName, make_method

_SOLUTIONS = {"grid": "solves", "sharp": "fields"}
# Of the load path of ``grid``: it costs little and leaves the nodes as the source of error.
_GRID_ACCURACY = 1e-3
_WARM_UP = {"grid": 8, "sharp": 1e-2}
# CPU seconds for start and warm-up, before the limit of the run applies.
_START_LIMIT = 300.0
_MB = 1e6


@dataclass(frozen=True)
class Run:
    """Method, setting and limits of a measured loop."""

    scene: Scene
    method: MethodName
    setting: float  # nodes per shortest wave of ``grid``, accuracy of ``sharp``
    load_steps: int
    seconds: float  # CPU seconds after which the run is given up

    @property
    def described(self) -> str:
        """The setting in short: nodes per shortest wave, or accuracy."""
        return f"{self.setting:g} nodes" if self.method == "grid" else f"{self.setting:.0e}"


@dataclass(frozen=True)
class Measurement:
    """Cost and result of a run; NaN and zero if it did not finish."""

    cpu_seconds: float = float("nan")  # time from the problem to the finished loop
    megabytes: float = float("nan")  # largest resident memory of the process
    megabytes_before: float = float("nan")  # the same before the loop: interpreter, libraries
    loss: float = float("nan")  # loop integral in J/m² of nominal area
    loss_dimensionless: float = float("nan")  # W~
    audit_residual: float = float("nan")  # (loop integral - sum of drops) / loop integral
    solutions: int = 0  # number of elastic solutions for given edges or contact sets
    jumps: int = 0
    patches: int = 0  # most at a time
    note: str = ""  # reason why the run did not finish; else empty


def measure(run: Run) -> Measurement:
    """Run and measure in a fresh process.

    A run that fails or takes too long is a :class:`Measurement` with a note, not an exception.
    """
    # One thread: on matrices of a few dozen rows, threads of the linear algebra only add CPU time.
    command = launch.python("-m", "adhesis.ensemble.bench.measure", pickle.dumps(run).hex())
    environment = launch.python_environment() | launch.ONE_THREAD
    child = subprocess.run(command, env=environment, capture_output=True, text=True)
    if child.returncode == -signal.SIGXCPU:
        return Measurement(note=f"given up after {run.seconds:g} s")
    if child.returncode:
        last = (child.stderr.strip().splitlines() or [f"exit code {child.returncode}"])[-1]
        return Measurement(note=f"failed: {last}")
    return Measurement(**json.loads(child.stdout))


def main() -> None:
    """Measure the run in the first argument in this process; end it when its seconds are over."""
    run: Run = pickle.loads(bytes.fromhex(sys.argv[1]))
    _limit(_START_LIMIT)
    # Touch, jumps, merging and vanishing in well below a second: a method loads all it uses.
    _loop(replace(run, scene=SMALL_ROUGH, setting=_WARM_UP[run.method], load_steps=4))
    before = launch.peak_bytes()
    _limit(run.seconds)
    started = process_time()
    loop = _loop(run)
    measured = Measurement(
        *(process_time() - started, max(before, launch.peak_bytes()) / _MB, before / _MB),
        *(loop.loss, loop.loss_dimensionless, loop.audit_residual),
        solutions=int(asdict(loop.method)[_SOLUTIONS[run.method]]),
        jumps=len(loop.jumps),
        patches=int(loop.patches.max()),
    )
    print(json.dumps(asdict(measured)))


def _loop(run: Run) -> LoopResult:
    accuracy, nodes = run.setting, None
    if run.method == "grid":
        accuracy, nodes = _GRID_ACCURACY, int(run.setting)
    problem = run.scene.problem()
    built = make_method(run.method, problem, accuracy=accuracy, nodes_per_wave=nodes)
    return run_loop(built, max_penetration=run.scene.max_penetration, load_steps=run.load_steps)


def _limit(seconds: float) -> None:
    """End this process after so many more seconds of CPU time (rounded up)."""
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(process_time() + seconds), hard))


if __name__ == "__main__":
    launch.end_with_parent()
    main()
