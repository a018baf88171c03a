"""Hysteresis loops of rough contacts with zero-range (JKR) adhesion: the public names.

Everything that a user of the library needs is imported from here; other names may change without
notice. Lengths in m, stresses in Pa (compression positive), energies per unit depth in J/m, losses
per nominal area in J/m². A star import takes everything but ``open``, which would replace the
built-in one.

A module is loaded when the first of its names is asked for: commands that answer from the command
line alone, such as ``adhesis --help``, load neither numpy nor the solver.
"""

from __future__ import annotations

from importlib import import_module

from adhesis._version import __version__ as __version__

# As type checkers know it. The module typing would load for longer than all that is needed before a
# command can be interrupted without a traceback.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from adhesis._campaign import Campaign
    from adhesis._open import open as open
    from adhesis.ensemble.errors import InputError
    from adhesis.ensemble.loop.saved import load
    from adhesis.ensemble.trace.answer import loss_of_trace
    from adhesis.ensemble.trace.prepare import prepare_trace
    from adhesis.ensemble.trace.reading.measured_trace import Trace, read_trace
    from adhesis.solver.loading.loop import run_loop, run_loops
    from adhesis.solver.loading.loop_result import LoopResult
    from adhesis.solver.loading.loop_state import LoopState
    from adhesis.solver.loading.path import MinorLoop, PathResult, run_path
    from adhesis.solver.method import ContactState, Fields, Method, Opening, Path, PathError
    from adhesis.solver.model.control import Control
    from adhesis.solver.model.half_space import HalfSpace
    from adhesis.solver.model.jump import Jump
    from adhesis.solver.model.pattern import AdhesionPattern, stripes
    from adhesis.solver.model.problem import Problem
    from adhesis.solver.model.profile import (
        Profile,
        profile_from_heights,
        self_affine_profile,
        single_wave,
    )
    from adhesis.solver.registry import make_method

# The same list for the running program; a test compares the two.
_MODULES = {
    "AdhesionPattern": "solver.model.pattern",
    "Campaign": "_campaign",
    "ContactState": "solver.method",
    "Control": "solver.model.control",
    "Fields": "solver.method",
    "HalfSpace": "solver.model.half_space",
    "InputError": "ensemble.errors",
    "Jump": "solver.model.jump",
    "LoopResult": "solver.loading.loop_result",
    "LoopState": "solver.loading.loop_state",
    "Method": "solver.method",
    "MinorLoop": "solver.loading.path",
    "Opening": "solver.method",
    "Path": "solver.method",
    "PathError": "solver.method",
    "PathResult": "solver.loading.path",
    "Problem": "solver.model.problem",
    "Profile": "solver.model.profile",
    "Trace": "ensemble.trace.reading.measured_trace",
    "load": "ensemble.loop.saved",
    "loss_of_trace": "ensemble.trace.answer",
    "make_method": "solver.registry",
    "open": "_open",
    "prepare_trace": "ensemble.trace.prepare",
    "profile_from_heights": "solver.model.profile",
    "read_trace": "ensemble.trace.reading.measured_trace",
    "run_loop": "solver.loading.loop",
    "run_loops": "solver.loading.loop",
    "run_path": "solver.loading.path",
    "self_affine_profile": "solver.model.profile",
    "single_wave": "solver.model.profile",
    "stripes": "solver.model.pattern",
}

__all__ = [
    "AdhesionPattern",
    "Campaign",
    "ContactState",
    "Control",
    "Fields",
    "HalfSpace",
    "InputError",
    "Jump",
    "LoopResult",
    "LoopState",
    "Method",
    "MinorLoop",
    "Opening",
    "Path",
    "PathError",
    "PathResult",
    "Problem",
    "Profile",
    "Trace",
    "load",
    "loss_of_trace",
    "make_method",
    "prepare_trace",
    "profile_from_heights",
    "read_trace",
    "run_loop",
    "run_loops",
    "run_path",
    "self_affine_profile",
    "single_wave",
    "stripes",
]


def _views() -> object:
    """Return what makes figures and films of results: outside of the mechanics, and loaded late."""
    return import_module("adhesis.ensemble.loop.views")


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(f"adhesis.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})
