"""Solids, profiles and problems that several tests use."""

from __future__ import annotations

from adhesis import HalfSpace, Problem, self_affine_profile

HALF_SPACE = HalfSpace(young=1e6, poisson=0.5)


def small_problem(work_of_adhesion: float) -> Problem:
    """Build a problem with few waves, whose loops take less than a second."""
    profile = self_affine_profile(0.8, period=1e-3, n0=2, ratio=4, seed=3, h_rms=1e-6)
    return Problem(profile, HALF_SPACE, work_of_adhesion)
