"""Contact mechanics of rough periodic profiles with zero-range (JKR) adhesion.

Knows nothing of MPI, files or campaigns. Lengths in m, stresses in Pa (compression positive),
energies per unit depth in J/m, per nominal area in J/m².
"""

from solver.jumps import Jump
from solver.loop import LoopResult, run_loop
from solver.material import HalfSpace
from solver.method import ContactState, Fields, Method, Path
from solver.methods import make_method
from solver.problem import Problem
from solver.profile import Profile, profile_from_heights, self_affine_profile, single_wave

__all__ = [
    "ContactState",
    "Fields",
    "HalfSpace",
    "Jump",
    "LoopResult",
    "Method",
    "Path",
    "Problem",
    "Profile",
    "make_method",
    "profile_from_heights",
    "run_loop",
    "self_affine_profile",
    "single_wave",
]
