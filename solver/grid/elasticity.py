"""Elastic half-space on a periodic grid: displacement and stress.

A stress of wave number q ≠ 0 displaces the surface by v_q = 2 σ_q/(E*|q|) (plane strain; Johnson,
Contact Mechanics, section 13.2). The uniform displacement is part of the separation: v has zero
mean, and the operator's symbol at q = 0 is zero.
"""

from __future__ import annotations

import numpy as np

from adhesis.solver.grid.fourier import RealFourier, symbol
from adhesis.solver.model.profile import Array


class ElasticGrid:
    """Compliance of the half-space on n equally spaced nodes of one period.

    Parameters
    ----------
    n : int
        Number of nodes, even.
    period : float
        λ in m.
    modulus : float
        E* in Pa.

    Attributes
    ----------
    dx : float
        Distance of two nodes, in m.
    """

    def __init__(self, n: int, period: float, modulus: float) -> None:
        self.n = n
        self.period = period
        self.dx = period / n
        self.modulus = modulus
        self._fourier = RealFourier(n)
        q = 2 * np.pi / period * np.arange(n // 2 + 1)
        stiffness = 0.5 * modulus * q / n
        compliance = np.zeros_like(q)
        compliance[1:] = 2 / (modulus * q[1:]) / n
        # The opposite-order operator is singular at q = 0, which a preconditioner must not be: the
        # mean gets the stiffness of the longest wave.
        preconditioner = stiffness.copy()
        preconditioner[0] = stiffness[1]
        self._stiffness, self._compliance = symbol(stiffness), symbol(compliance)
        self._preconditioner = symbol(preconditioner)

    def displacement(self, stress: Array) -> Array:
        """Compute v in m (zero mean) of a stress in Pa, in the buffer of ``multiply``."""
        return self._fourier.multiply(self._compliance, stress)

    def stress(self, displacement: Array) -> Array:
        """Compute the stress in Pa (zero mean) of a displacement v in m, in the same buffer."""
        return self._fourier.multiply(self._stiffness, displacement)

    def precondition(self, residual: Array) -> Array:
        """Compute an approximate stress in Pa for a residual in m, in the same buffer."""
        return self._fourier.multiply(self._preconditioner, residual)

    def kernel(self) -> Array:
        """Compute the first column of V, shape (n,), in m/Pa: displacement by 1 Pa on node 0."""
        unit = np.zeros(self.n)
        unit[0] = 1.0
        return self.displacement(unit).copy()
