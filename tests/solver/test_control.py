"""Controls: the potential's derivative is the conjugate; layers; what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from adhesis.solver.model.control import Control
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.references.single_wave import SingleWave

WAVE = SingleWave.with_alpha(0.3, 1e-6, 1e-3, 1e6)
UNIT = WAVE.full_contact_stress / WAVE.amplitude


@pytest.mark.parametrize("relative", [np.inf, 3.0, 0.1, 0.0])
def test_the_potential_falls_by_the_conjugate_along_an_equilibrium_branch(relative):
    """dW/dx = -λ Y, on Johnson's branch."""
    control = Control(relative * UNIT)
    a = np.linspace(0.2, 0.3, 2001) * WAVE.period
    s, p, u = WAVE.separation(a), WAVE.mean_stress(a), WAVE.energy(a)
    x = control.prescribed(s, p)
    y = control.conjugate(s, p, WAVE.amplitude)
    w = [
        control.potential(*values, WAVE.amplitude, WAVE.period)
        for values in zip(u, s, p, strict=True)
    ]
    work = -WAVE.period * np.trapezoid(y, x)
    assert w[-1] - w[0] == pytest.approx(work, rel=1e-6)
    assert np.all(np.diff(x) < 0)  # the branch is stable, and loading is towards smaller x


def test_far_side_moves_by_the_penetration_and_the_springs_shortening():
    assert Control(2e9).displacement(1e-6, 500.0, 3e-6) == pytest.approx(2.25e-6)
    assert Control().displacement(1e-6, 500.0, 3e-6) == pytest.approx(2e-6)


def test_a_layer_without_room_to_spread():
    """ν = 0: E/d. Towards ν = 0.5 it becomes rigid, and there it is refused."""
    assert HalfSpace(2e6, 0.0).layer_stiffness(1e-2) == pytest.approx(2e8)
    assert HalfSpace(2e6, 0.4999).layer_stiffness(1e-2) > 1e11
    with pytest.raises(ValueError, match=r"poisson is 0\.5"):
        HalfSpace(2e6, 0.5).layer_stiffness(1e-2)
    with pytest.raises(ValueError, match="thickness is 0"):
        HalfSpace(2e6, 0.3).layer_stiffness(0)
