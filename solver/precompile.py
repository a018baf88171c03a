"""Compile ahead of time all functions that loops and fields of a method call."""

from __future__ import annotations

import gc
import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from adhesis.solver.loading.loop import run_loop
from adhesis.solver.method import Branch, ContactState
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import self_affine_profile
from adhesis.solver.registry import make_method
from adhesis.solver.runtime.compile_log import silence_compile_log
from adhesis.solver.runtime.disk_cache import installed_folder
from adhesis.solver.runtime.jit import (
    Compilation,
    code_files,
    kept_in_installation,
    processor,
    settings,
    watch_compilation,
)
from adhesis.solver.sharp.method import SharpMethod

COMPILED_METHODS = ("sharp", "grid")
# Number of functions that each part compiles, numba's own included, for the progress of a
# compilation. The code of ``sharp`` for many gaps is a part of its own: most loops never call it.
_FUNCTIONS = {"sharp": 286, "many": 112, "grid": 12}

__all__ = [
    "COMPILED_METHODS",
    "Compilation",
    "compiled_in",
    "functions_of",
    "in_installation",
    "processor",
    "settings",
    "warm",
    "watch_compilation",
]


def warm(
    methods: Iterable[str] = COMPILED_METHODS,
    *,
    report: Callable[[Compilation], None] = lambda seen: None,
    to_installation: bool = False,
    many_gaps: bool = True,
) -> Compilation:
    """Compile the functions of the methods, or load their cached code, by running small loops.

    Parameters
    ----------
    methods : iterable of str
        Of :data:`COMPILED_METHODS`.
    report : callable
        Called when the compilation of a function begins.
    to_installation : bool
        Keep the code in the installation, if that can be written, for all its users and nodes.
    many_gaps : bool
        Whether ``sharp`` is compiled for many gaps, too. Otherwise that is done when a loop first
        has as many.

    Returns
    -------
    Compilation
        Number of functions compiled now, and the time that took.
    """
    with watch_compilation(report) as seen, silence_compile_log(), _without_garbage_collection():
        for method in methods:
            if to_installation:
                with kept_in_installation():
                    _small_loops(method, many_gaps)
            else:
                _small_loops(method, many_gaps)
            _mark(method, to_installation, many_gaps)
    return seen


@contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """Suspend garbage collection, which is slow among millions of objects of the compiler."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def compiled_in(method: str, *, many_gaps: bool = True) -> Path | None:
    """Return the folder with the code of a method for this processor and settings, or None."""
    whole = code_files().find(_marker(method))
    if whole is None and not many_gaps:
        return code_files().find(_marker(method, many_gaps=False))
    return whole


def functions_of(methods: Iterable[str], *, many_gaps: bool = True) -> int:
    """Return about how many functions are still to be compiled for these methods."""
    names = list(methods)
    parts = [name for name in names if compiled_in(name, many_gaps=False) is None]
    if many_gaps and "sharp" in names and compiled_in("sharp") is None:
        parts.append("many")
    return sum(_FUNCTIONS[part] for part in parts)


def in_installation(folder: Path) -> bool:
    """Return True for the installation's folder of compiled code, False for the user's."""
    return folder.is_relative_to(installed_folder())


def _marker(method: str, many_gaps: bool = True) -> str:
    """Return the name of the file that marks a method as compiled; it changes with this module."""
    made_by = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:8]
    part = "-few-gaps" if method == "sharp" and not many_gaps else ""
    return f"{method}{part}-{made_by}.json"


def _mark(method: str, to_installation: bool, many_gaps: bool) -> None:
    files = code_files(to_installation)
    marker = _marker(method, many_gaps)
    if files.read(marker) is None:
        entries = {"method": method, "processor": processor(), **settings()}
        files.write(marker, json.dumps(entries, indent=1).encode())


def small_problem(work_of_adhesion: float) -> Problem:
    """Build a problem with few waves, whose loops take less than a second."""
    profile = self_affine_profile(0.8, period=1e-3, n0=2, ratio=4, seed=3, h_rms=1e-6)
    return Problem(profile, HalfSpace(young=1e6, poisson=0.5), work_of_adhesion)


def _hierarchical() -> SharpMethod:
    """Build a method that uses its hierarchical solver from 6 gaps on, for a profile with more."""
    profile = self_affine_profile(0.8, period=2e-3 * np.pi, n0=10, ratio=4, seed=1, h_rms=1e-6)
    method = SharpMethod(Problem(profile, HalfSpace(young=1e6, poisson=0.5), 0.004))
    return method


def _small_loops(method: str, many_gaps: bool = True) -> None:
    """Run loops that call all compiled functions with all types of arguments that occur."""
    for work_of_adhesion in (0.04, 0.0):
        problem = small_problem(work_of_adhesion)
        chosen = (
            make_method("grid", problem, nodes_per_wave=8)
            if method == "grid"
            else make_method("sharp", problem)
        )
        states: list[ContactState] = []

        def keep(_: Branch, state: ContactState, states: list[ContactState] = states) -> None:
            states.append(state)

        run_loop(chosen, max_penetration=0.8, load_steps=2, on_state=keep)
        if isinstance(chosen, SharpMethod) and many_gaps and work_of_adhesion > 0:
            run_loop(_hierarchical(), max_penetration=0.5, load_steps=2)
        state = max(states, key=lambda state: state.patches)
        chosen.fields(state, chosen.nodes or 256)
        chosen.openings(state)
