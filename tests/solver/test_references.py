"""Full contact, Koiter's punch and the parabola, each checked independently."""

import numpy as np
import pytest
from scipy.integrate import quad

from adhesis import self_affine_profile, single_wave
from adhesis.solver.references.full_contact import full_contact_energy, full_contact_stress
from adhesis.solver.references.parabola import parabola_load, parabola_pull_off
from adhesis.solver.references.periodic_punch import pull_off_stress

MODULUS = 1.3
ROUGH = self_affine_profile(0.8, period=2.0, n0=2, ratio=6, seed=5, h_rms=0.01)


def test_full_contact_stress_displaces_the_surface_onto_the_profile():
    """The displacement by quadrature over the periodic logarithmic kernel, no Fourier series."""

    def displacement(x: float) -> float:
        def integrand(xi: float) -> float:
            kernel = np.log(2 * abs(np.sin(np.pi * (x - xi) / 2.0)) + 1e-300)
            return float(full_contact_stress(ROUGH, MODULUS, xi)) * kernel

        left = quad(integrand, x - 1.0, x, limit=400)[0]
        right = quad(integrand, x, x + 1.0, limit=400)[0]
        return -2 / (np.pi * MODULUS) * (left + right)

    for x in (0.1, 0.77, 1.6):
        assert displacement(x) == pytest.approx(float(ROUGH.at(x)), abs=1e-8)


def test_full_contact_energy_is_half_the_work_and_adds_up_over_waves():
    work = quad(
        lambda x: float(full_contact_stress(ROUGH, MODULUS, x) * ROUGH.at(x)), 0, 2, limit=400
    )[0]
    assert full_contact_energy(ROUGH, MODULUS) == pytest.approx(work / 2 / 2.0, rel=1e-9)
    wave = single_wave(0.02, 2.0)
    assert full_contact_energy(wave, MODULUS) == pytest.approx(MODULUS * np.pi * 0.02**2 / 8)


def punch_separation(a: float, period: float, mean_stress: float) -> float:
    """Mean gap s of Koiter's strips of half-width a under the mean stress p̄."""
    return mean_stress * period / (np.pi * MODULUS) * np.log(np.sin(np.pi * a / period) ** 2)


def test_punch_pull_off_is_the_energy_balance():
    """At fixed s, the energy that is released with an edge is γ at pull-off."""
    period, gamma, a, d = 2.0, 0.3, 0.6, 1e-5
    p = float(pull_off_stress(a, period, MODULUS, gamma))
    s = punch_separation(a, period, p)

    def elastic(half: float) -> float:
        unit = punch_separation(half, period, 1.0)
        return -0.5 * period * s * (s / unit)  # ½∫σ(0 - s) with p̄ = s/unit

    release = (elastic(a + d) - elastic(a - d)) / (2 * d) / 2
    assert release == pytest.approx(gamma, rel=1e-8)


def test_punch_limits_are_kendall_and_griffith():
    period, gamma = 2.0, 0.3
    a = 1e-4
    kendall = -np.sqrt(2 * np.pi * MODULUS * gamma * a)
    assert period * float(pull_off_stress(a, period, MODULUS, gamma)) == pytest.approx(
        kendall, rel=1e-7
    )
    c = 1e-4
    griffith = -np.sqrt(2 * MODULUS * gamma / (np.pi * c))
    assert float(pull_off_stress(period / 2 - c, period, MODULUS, gamma)) == pytest.approx(
        griffith, rel=1e-7
    )


def test_parabola_pull_off_is_the_least_load():
    radius, gamma = 2.5, 0.4
    a, load = parabola_pull_off(radius, MODULUS, gamma)
    assert float(parabola_load(a, radius, MODULUS, gamma)) == pytest.approx(load, rel=1e-14)
    around = parabola_load(a * np.linspace(0.2, 3, 1001), radius, MODULUS, gamma)
    assert np.all(around >= load * (1 + 1e-12))


@pytest.mark.parametrize("a", [0.3, 1.1])
def test_parabola_load_solves_the_integral_equation(a):
    """That of the line load, by Gauss-Chebyshev (Erdogan's scheme).

    (2/(πE*)) PV∫ σ(ξ)/(x - ξ) dξ = -h'(x), with σ = g(ξ/a)/sqrt(1 - (ξ/a)²) and the edge values
    of g fixed by K = sqrt(2E*γ): σ ≈ -K/sqrt(2πr).
    """
    radius, gamma, n = 2.5, 0.05, 400
    t = np.cos((np.arange(n) + 0.5) * np.pi / n)
    x = np.cos(np.arange(1, n) * np.pi / n)
    rows = (2 / (np.pi * MODULUS)) * (np.pi / n) / (x[:, None] - t[None, :])
    # g at +1 by Chebyshev interpolation through the nodes.
    weights = (-1.0) ** np.arange(n) / np.tan((np.arange(n) + 0.5) * np.pi / (2 * n)) / n
    edge = -np.sqrt(2 * MODULUS * gamma) / np.sqrt(np.pi * a)
    g = np.linalg.solve(np.vstack([rows, weights]), np.append(a * x / radius, edge))
    solved = np.sum(g) * np.pi / n * a
    assert float(parabola_load(a, radius, MODULUS, gamma)) == pytest.approx(solved, rel=1e-10)
