"""Real Fourier transforms with bit-wise reproducible results.

Measured FFTW plans differ from run to run, and so do the last bits of their results, which can
change the path of a contact close to instability. Hence estimated plans and one thread.
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
