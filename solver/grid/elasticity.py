"""Elastic half-space on a periodic grid: displacement, and a preconditioner.

A stress of wave number q ≠ 0 displaces the surface by v_q = 2 σ_q/(E*|q|) (plane strain; Johnson,
Contact Mechanics, section 13.2). The uniform displacement is part of the separation: v has zero
mean, and the operator's symbol at q = 0 is zero.
"""

from __future__ import annotations

import numpy as np
import pyfftw

from adhesis.solver.model.profile import Array


class ElasticGrid:
    """Compliance of the half-space on n equally spaced nodes of one period.

    Their number is even, the period in m and E* in Pa. The transforms have their own buffers: each
    result is valid until the next one is computed.
    """

    def __init__(self, n: int, period: float, modulus: float) -> None:
        self.n, self.period, self.modulus = n, period, modulus
        self.dx = period / n
        self._values: Array = pyfftw.zeros_aligned(n, dtype=np.float64)
        spectrum = pyfftw.zeros_aligned(n // 2 + 1, dtype=np.complex128)
        self._parts: Array = spectrum.view(np.float64)
        options = {"flags": ("FFTW_ESTIMATE", "FFTW_DESTROY_INPUT"), "threads": 1}
        self._forward = pyfftw.FFTW(self._values, spectrum, **options)
        self._inverse = pyfftw.FFTW(spectrum, self._values, direction="FFTW_BACKWARD", **options)
        q = 2 * np.pi / period * np.arange(n // 2 + 1)
        compliance = np.zeros_like(q)
        compliance[1:] = 2 / (modulus * q[1:]) / n
        # The opposite-order operator is singular at q = 0, which a preconditioner must not be: the
        # mean gets the stiffness of the longest wave.
        stiffness = 0.5 * modulus * q / n
        stiffness[0] = stiffness[1]
        # twice each, for the real and the imaginary part: numpy would convert real factors to
        # complex ones in every product
        self._compliance, self._stiffness = np.repeat(compliance, 2), np.repeat(stiffness, 2)

    def _multiply(self, symbol: Array, field: Array) -> Array:
        """Apply the circulant operator with a symbol, over n, to a field."""
        self._values[:] = field
        self._forward.execute()
        np.multiply(self._parts, symbol, out=self._parts)
        self._inverse.execute()
        return self._values

    def displacement(self, stress: Array) -> Array:
        """Compute v in m (zero mean) of a stress in Pa."""
        return self._multiply(self._compliance, stress)

    def precondition(self, residual: Array) -> Array:
        """Compute an approximate stress in Pa for a residual in m."""
        return self._multiply(self._stiffness, residual)

    def kernel(self) -> Array:
        """Compute the first column of V, shape (n,), in m/Pa: displacement by 1 Pa on node 0."""
        unit = np.zeros(self.n)
        unit[0] = 1.0
        return self.displacement(unit).copy()
