"""Elastic half-space on a periodic grid: displacement and stress.

A stress of wave number q ≠ 0 displaces the surface by v_q = 2 σ_q/(E*|q|) (plane strain; Johnson,
Contact Mechanics, section 13.2). The uniform displacement is part of the separation: v has zero
mean, and the operator's symbol at q = 0 is zero.
"""

from __future__ import annotations

import numpy as np
import pyfftw
from numpy.typing import NDArray

from adhesis.solver.model.profile import Array


def symbol(eigenvalues: Array) -> Array:
    """Repeat real eigenvalues of a circulant operator, shape (n // 2 + 1,), for ``multiply``.

    The result, shape (n + 2,), has each twice, for the real and the imaginary part, as numpy would
    convert real factors to complex ones in every product.
    """
    return np.repeat(eigenvalues, 2)


class RealFourier:
    """Pair of real transforms of n values with their own buffers.

    Parameters
    ----------
    n : int
        Number of values, at least 2.

    Attributes
    ----------
    values : array, shape (n,)
        Input of :meth:`forward`, output of :meth:`inverse`.
    spectrum : complex array, shape (n // 2 + 1,)
        Output of :meth:`forward`, input of :meth:`inverse` (which destroys it).
    """

    def __init__(self, n: int) -> None:
        self.n = n
        self.values: Array = pyfftw.zeros_aligned(n, dtype=np.float64)
        self.spectrum: NDArray[np.complex128] = pyfftw.zeros_aligned(
            n // 2 + 1, dtype=np.complex128
        )
        self._parts: Array = self.spectrum.view(np.float64)
        options = {"flags": ("FFTW_ESTIMATE", "FFTW_DESTROY_INPUT"), "threads": 1}
        self._forward = pyfftw.FFTW(self.values, self.spectrum, **options)
        self._inverse = pyfftw.FFTW(
            self.spectrum, self.values, direction="FFTW_BACKWARD", **options
        )

    def forward(self) -> None:
        """Transform ``values`` to ``spectrum``: Σ_j f_j exp(-2πi jk/n), without a factor."""
        self._forward.execute()

    def inverse(self) -> None:
        """Transform ``spectrum`` to ``values``: n times the inverse of :meth:`forward`."""
        self._inverse.execute()

    def multiply(self, by: Array, field: Array) -> Array:
        """Apply a circulant operator to a field.

        Parameters
        ----------
        by : array, shape (n + 2,)
            :func:`symbol` of the operator's eigenvalues, divided by n.
        field : array, shape (n,)

        Returns
        -------
        array, shape (n,)
            The buffer ``values``, valid until the next transform.
        """
        self.values[:] = field
        self._forward.execute()
        np.multiply(self._parts, by, out=self._parts)
        self._inverse.execute()
        return self.values


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
