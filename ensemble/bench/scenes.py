"""Define the scenes of the benchmark: from one wave with an exact loss to the paper's scale.

All have the paper's period 2π mm and material (E = 1 MPa, ν = 0.5, arXiv 1511.08891), in SI units.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Profile, self_affine_profile, single_wave
from adhesis.solver.references.single_wave import SingleWave

HALF_SPACE = HalfSpace(1e6, 0.5)
_PERIOD = 2e-3 * np.pi
# With this amplitude (m) the area along the profile (solver) and the flat one (closed form) give
# the same loss to 1e-8.
_SHALLOW = 1e-4 * _PERIOD / (2 * np.pi)
_EXACT = SingleWave.with_alpha(0.2, _SHALLOW, _PERIOD, HALF_SPACE.modulus)
_AMPLITUDE = 1e-6
# The ripple pins the edges some ten times in each direction. It is out of phase: in a symmetric
# profile both edges of the patch become unstable at once, and the path then depends on rounding, or
# on the rule for symmetric states.
_RIPPLE_HARMONIC, _RIPPLE, _RIPPLE_PHASE = 12, 0.06, 1.0
_HURST, _H_RMS, _SEED = 0.8, 1e-6, 1


@dataclass(frozen=True)
class Scene:
    """One problem, its cycle, and the resolutions at which the methods are measured."""

    name: str
    title: str
    problem: Callable[[], Problem]
    max_penetration: float = 0.9
    load_steps: int = 40  # steps from first touch to ``max_penetration`` (Δ~max)
    grids: tuple[int, ...] = (8, 16, 32, 64)  # lower bounds of the nodes per shortest wave
    # Requested accuracies of the loss, low to high
    accuracies: tuple[float, ...] = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
    # Accuracies of the reference run of ``sharp``, best first; the first that succeeds is used.
    # Empty if the loss is known exactly.
    tightest: tuple[float, ...] = ()
    reference_load_steps: int = 80  # load steps of the reference run
    exact_loss: float | None = None  # in J/m² of nominal area, if it is known in closed form


def _two_waves(work_of_adhesion: float) -> Problem:
    """A cos(q0 x) with a ripple."""
    waves = np.zeros(_RIPPLE_HARMONIC + 1, dtype=np.complex128)
    waves[1], waves[-1] = 0.5, 0.5 * _RIPPLE * np.exp(1j * _RIPPLE_PHASE)
    profile = Profile(_PERIOD, waves).scaled(_AMPLITUDE)
    return Problem(profile, HALF_SPACE, work_of_adhesion)


def _rough(work_of_adhesion: float, n0: int, ratio: int) -> Problem:
    """A self-affine profile; ``ratio``: highest harmonic over the lowest, ``n0``."""
    profile = self_affine_profile(
        _HURST, period=_PERIOD, n0=n0, ratio=ratio, seed=_SEED, h_rms=_H_RMS
    )
    return Problem(profile, HALF_SPACE, work_of_adhesion)


ONE_WAVE = Scene(
    name="one-wave",
    title="one wave, α = 0.2",
    problem=partial(Problem, single_wave(_SHALLOW, _PERIOD), HALF_SPACE, _EXACT.work_of_adhesion),
    max_penetration=0.5,
    load_steps=10,
    # The wave is the whole profile: its contact of 0.18 λ needs many nodes.
    grids=(64, 256, 1024, 4096),
    exact_loss=_EXACT.loop.loss,
)
TWO_WAVES = Scene(
    name="two-waves",
    title="two waves, m = 1 and 12, γ = 0.01",
    problem=partial(_two_waves, 0.01),
    load_steps=20,
    grids=(16, 64, 256),
    tightest=(1e-8, 1e-7, 1e-6),
    reference_load_steps=20,
)
SMALL_ROUGH = Scene(
    name="rough-32",
    title="rough, m = 2 … 32, γ = 0.01",
    problem=partial(_rough, 0.01, n0=2, ratio=16),
    load_steps=20,
    tightest=(1e-8, 1e-7, 1e-6, 1e-5),
    reference_load_steps=40,
)
ROUGH = Scene(
    name="rough-250",
    title="rough, m = 10 … 250, γ = 0.01",
    problem=partial(_rough, 0.01, n0=10, ratio=25),
    grids=(8, 16, 32, 64, 128, 256),
    tightest=(1e-7, 1e-6, 1e-5, 1e-4),
)
PAPER = Scene(
    name="paper",
    title="the paper's scale, m = 10 … 1000, γ = 0.04",
    problem=partial(_rough, 0.04, n0=10, ratio=100),
    tightest=(1e-7, 1e-6, 1e-5, 1e-4),
)

QUICK = (ONE_WAVE, TWO_WAVES, SMALL_ROUGH)
FULL = (ONE_WAVE, TWO_WAVES, ROUGH, PAPER)
