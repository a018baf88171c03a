"""Hysteresis loops of rough contacts with zero-range (JKR) adhesion: the public names.

Everything that a user of the library needs is imported from here; other names may change without
notice. Lengths in m, stresses in Pa (compression positive), energies per unit depth in J/m, losses
per nominal area in J/m². Loads no MPI and no matplotlib. A star import takes everything but
``open``, which would replace the built-in one.
"""

from adhesis._open import open as open
from adhesis._version import __version__ as __version__
from ensemble.errors import InputError
from ensemble.trace.answer import loss_of_trace
from ensemble.trace.prepare import prepare_trace
from ensemble.trace.read import read_trace
from solver.control import Control
from solver.jumps import Jump
from solver.loop import run_loop
from solver.loop_result import LoopResult
from solver.material import HalfSpace
from solver.method import ContactState, Fields, Method, Opening, Path, PathError
from solver.path import MinorLoop, PathResult, run_path
from solver.problem import Problem
from solver.profile import Profile, profile_from_heights, self_affine_profile, single_wave
from solver.registry import make_method
from solver.turns import run_loops

__all__ = [
    "ContactState",
    "Control",
    "Fields",
    "HalfSpace",
    "InputError",
    "Jump",
    "LoopResult",
    "Method",
    "MinorLoop",
    "Opening",
    "Path",
    "PathError",
    "PathResult",
    "Problem",
    "Profile",
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
]
