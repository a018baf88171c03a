"""Compute openings at fine nodes, and the energy of a gap field: all modes, by sine transforms.

A gap's opening is T = Σ_n b_n sin((n+1)t), cos t = η. Below the M modes of (1) in ``gap_field``
b_n come from f; above them the straight crack gives b_n = -s_n/(n+1), with s_n the Chebyshev
moments of S_full over the gap. With p = 2p̄/E* the elastic energy of one period is

    U = (E*/(2 q0²)) · ½ [∫ S_full h~ dθ + ∫_gaps S_full T dθ - 2π q0 s p],      h~ = q0 h,

which follows from Betti's theorem; the first term is the energy of full contact.
"""

from __future__ import annotations

from dataclasses import dataclass

from adhesis.solver._kernels import SHAPE_NODES
from adhesis.solver.model.profile import Array
from adhesis.solver.sharp.field.gap_field import GapField


@dataclass(frozen=True)
class GapOpening:
    """Opening of one gap at its fine sine nodes, θ increasing.

    ``opening`` is T, ``weight`` the Gauss-Chebyshev weight of ∫ T g dθ divided by T, ``modes`` b_n.
    """

    theta: Array
    opening: Array
    weight: Array
    modes: Array


def fine_opening(field: GapField, k: int, per_wave: float = SHAPE_NODES) -> GapOpening:
    """Evaluate the opening T of gap k at fine nodes."""
    return GapOpening(*field.solution.fine_opening(k, per_wave))
