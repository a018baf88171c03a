"""Convert contact sets to contact states (effective edges, mean stress, energies) and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adhesis.solver.grid.contact import Contact
from adhesis.solver.grid.lattice import Lattice
from adhesis.solver.method import ContactState
from adhesis.solver.peaks import patch_ranges

EDGE_OFFSET = 0.190
"""An edge lies this many dx inside the outer face of its contact node (numerical calibration of the
edge stress against K/sqrt(2πr))."""


def state_of(lattice: Lattice, contact: Contact) -> ContactState:
    """Make the contact state of a solved contact.

    Its private data are the first node and the number of nodes of each patch, shape (patches, 2).
    """
    first, width = patch_ranges(contact.mask)
    if first.size == 0:
        return ContactState.detached(contact.separation)
    dx = lattice.dx
    inset = EDGE_OFFSET - 0.5
    left = (first + inset) * dx
    right = (first + width - 1 - inset) * dx
    wrapped = left < 0
    period = lattice.elastic.period
    left, right = left + wrapped * period, right + wrapped * period
    order = np.argsort(left, kind="stable")
    mean_stress = float(contact.stress.mean())
    hold = lattice.control.potential(0.0, contact.separation, mean_stress, lattice.h_max, period)
    area = float(width.sum()) - 2 * EDGE_OFFSET * first.size
    return ContactState(
        separation=contact.separation,
        edges=np.column_stack((left, right))[order],
        mean_stress=mean_stress,
        elastic_energy=contact.elastic_energy,
        adhesion_energy=lattice.adhesion_energy(contact),
        contact_fraction=area / lattice.n,
        hold_energy=hold,
        internal=np.column_stack((first, width)),
    )


def mask_of(lattice: Lattice, state: ContactState) -> NDArray[np.bool_]:
    """Return the contact set of a state in contact made by :func:`state_of`.

    Raises
    ------
    ValueError
        If another method made the state.
    """
    mask = np.zeros(lattice.n, dtype=bool)
    if not isinstance(state.internal, np.ndarray):
        raise ValueError("this state was not made by the method grid")
    for first, width in state.internal.tolist():
        mask[np.arange(first, first + width) % lattice.n] = True
    return mask
