"""Full contact, Koiter's punch, the parabola and the wavy parabola, each checked independently."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from adhesis import self_affine_profile, single_wave
from adhesis.solver.references.full_contact import full_contact_energy, full_contact_stress
from adhesis.solver.references.parabola import parabola_load, parabola_pull_off, parabola_stress
from adhesis.solver.references.periodic_punch import (
    pull_off_stress,
    punch_separation,
    punch_stress,
    punch_stress_intensity,
)
from adhesis.solver.references.single_wave import SingleWave
from adhesis.solver.references.wavy_parabola import WavyParabola

MODULUS = 1.3


# ---------------------------------------------------------------------- full contact


def rough():
    return self_affine_profile(0.8, period=2.0, n0=2, ratio=6, seed=5, h_rms=0.01)


def test_full_contact_stress_displaces_the_surface_onto_the_profile():
    """The displacement by quadrature over the periodic logarithmic kernel, no Fourier series."""
    profile = rough()

    def displacement(x: float) -> float:
        def integrand(xi: float) -> float:
            kernel = np.log(2 * abs(np.sin(np.pi * (x - xi) / 2.0)) + 1e-300)
            return float(full_contact_stress(profile, MODULUS, xi)) * kernel

        left = quad(integrand, x - 1.0, x, limit=400)[0]
        right = quad(integrand, x, x + 1.0, limit=400)[0]
        return -2 / (np.pi * MODULUS) * (left + right)

    for x in (0.1, 0.77, 1.6):
        assert displacement(x) == pytest.approx(float(profile.at(x)), abs=1e-8)


def test_full_contact_energy_is_half_the_work_and_adds_up_over_waves():
    profile = rough()
    work = quad(
        lambda x: float(full_contact_stress(profile, MODULUS, x) * profile.at(x)), 0, 2, limit=400
    )[0]
    assert full_contact_energy(profile, MODULUS) == pytest.approx(work / 2 / 2.0, rel=1e-9)
    wave = single_wave(0.02, 2.0)
    assert full_contact_energy(wave, MODULUS) == pytest.approx(MODULUS * np.pi * 0.02**2 / 8)


def test_full_contact_is_the_limit_of_johnsons_wave():
    wave = SingleWave(0.02, 2.0, MODULUS, 1e-3)
    profile = single_wave(0.02, 2.0)
    a = 1.0 * (1 - 1e-5)
    p, s = float(wave.mean_stress(a)), float(wave.separation(a))
    energy = float(wave.elastic_energy_at(a, s)) / 2.0 + 0.5 * s * p
    assert energy == pytest.approx(full_contact_energy(profile, MODULUS), rel=1e-5)
    x = np.array([0.0, 0.3, 0.6])
    assert wave.stress(x, a) - p == pytest.approx(
        full_contact_stress(profile, MODULUS, x), rel=1e-5
    )


# ---------------------------------------------------------------------- periodic punch


@pytest.mark.parametrize("a", [0.05, 0.5, 0.95])
def test_punch_stress_has_its_mean_and_leaves_flat_strips(a):
    """Mean by quadrature; the surface under the strip is flat, at the stated distance s."""
    period, mean = 2.0, -0.7

    def integral(weight) -> float:
        def integrand(theta: float) -> float:
            x = a * np.sin(theta)
            return float(punch_stress(x, a, period, mean)) * weight(x) * a * np.cos(theta)

        return quad(integrand, -np.pi / 2, np.pi / 2, limit=300)[0]

    assert integral(lambda x: 1.0) / period == pytest.approx(mean, rel=1e-9)
    s = float(punch_separation(a, period, MODULUS, mean))
    for x in (0.0, 0.5 * a, -0.8 * a):
        v = (
            -2
            / (np.pi * MODULUS)
            * integral(lambda xi, x=x: np.log(2 * abs(np.sin(np.pi * (x - xi) / period)) + 1e-300))
        )
        assert v == pytest.approx(-s, rel=1e-5)
    r = 1e-9 * a
    near = float(punch_stress(a - r, a, period, mean)) * np.sqrt(2 * np.pi * r)
    assert -near == pytest.approx(float(punch_stress_intensity(a, period, mean)), rel=1e-6)


def test_punch_pull_off_is_the_energy_balance():
    """At fixed s, energy release with the edge = K²/(2E*); at pull-off it is γ (per edge)."""
    period, gamma, a, d = 2.0, 0.3, 0.6, 1e-5
    p = float(pull_off_stress(a, period, MODULUS, gamma))
    s = float(punch_separation(a, period, MODULUS, p))

    def elastic(half: float) -> float:
        unit = float(punch_separation(half, period, MODULUS, 1.0))
        return -0.5 * period * s * (s / unit)  # ½∫σ(0 - s) with p̄ = s/unit

    release = (elastic(a + d) - elastic(a - d)) / (2 * d) / 2
    assert release == pytest.approx(gamma, rel=1e-8)
    k = float(punch_stress_intensity(a, period, p))
    assert k**2 / (2 * MODULUS) == pytest.approx(gamma, rel=1e-13)


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


# ---------------------------------------------------------------------- parabola


def test_parabola_stress_carries_the_load_and_balances_at_the_edge():
    radius, gamma, a = 2.5, 0.4, 0.9

    def integrand(theta: float) -> float:
        x = a * np.sin(theta)
        return float(parabola_stress(x, a, radius, MODULUS, gamma)) * a * np.cos(theta)

    load = quad(integrand, -np.pi / 2, np.pi / 2)[0]
    assert load == pytest.approx(float(parabola_load(a, radius, MODULUS, gamma)), rel=1e-9)
    r = 1e-9
    k = -float(parabola_stress(a - r, a, radius, MODULUS, gamma)) * np.sqrt(2 * np.pi * r)
    assert k**2 / (2 * MODULUS) == pytest.approx(gamma, rel=1e-4)


def test_parabola_pull_off_is_the_least_load():
    radius, gamma = 2.5, 0.4
    a, load = parabola_pull_off(radius, MODULUS, gamma)
    assert float(parabola_load(a, radius, MODULUS, gamma)) == pytest.approx(load, rel=1e-14)
    around = parabola_load(a * np.linspace(0.2, 3, 1001), radius, MODULUS, gamma)
    assert np.all(around >= load * (1 + 1e-12))


# ---------------------------------------------------------------------- wavy parabola


def solved_load(slope, a: float, gamma: float, n: int = 400) -> float:
    """Line load from the singular integral equation, by Gauss-Chebyshev (Erdogan's scheme).

    (2/(πE*)) PV∫ σ(ξ)/(x - ξ) dξ = -h'(x), with σ = g(ξ/a)/sqrt(1 - (ξ/a)²) and the edge values
    of g fixed by K = sqrt(2E*γ): σ ≈ -K/sqrt(2πr).
    """
    t = np.cos((np.arange(n) + 0.5) * np.pi / n)
    x = np.cos(np.arange(1, n) * np.pi / n)
    rows = (2 / (np.pi * MODULUS)) * (np.pi / n) / (x[:, None] - t[None, :])
    # g at +1 by Chebyshev interpolation through the nodes.
    weights = (-1.0) ** np.arange(n) / np.tan((np.arange(n) + 0.5) * np.pi / (2 * n)) / n
    edge = -np.sqrt(2 * MODULUS * gamma) / np.sqrt(np.pi * a)
    g = np.linalg.solve(np.vstack([rows, weights]), np.append(slope(a * x), edge))
    return float(np.sum(g) * np.pi / n * a)


@pytest.mark.parametrize("amplitude", [0.0, 0.01, -0.02])
@pytest.mark.parametrize("a", [0.3, 1.1])
def test_wavy_parabola_load_solves_the_integral_equation(amplitude, a):
    radius, k, gamma = 2.5, 9.0, 0.05
    wavy = WavyParabola(radius, amplitude, k, MODULUS, gamma)

    def slope(x):  # -h'
        return x / radius + amplitude * k * np.sin(k * x)

    assert float(wavy.load(a)) == pytest.approx(solved_load(slope, a, gamma), rel=1e-10)


def test_wavy_parabola_folds_bound_the_unstable_stretches():
    wavy = WavyParabola(2.5, 0.02, 12.0, MODULUS, 0.05)
    folds = wavy.folds(2.0)
    assert len(folds) >= 3
    h = 1e-6
    for a in folds:
        assert float(wavy.load(a + h) - wavy.load(a - h)) / (2 * h) == pytest.approx(0.0, abs=1e-8)
    a = np.linspace(1e-3, 2.0, 40_001)
    turning = np.count_nonzero(np.diff(np.sign(np.diff(wavy.load(a)))))
    assert turning == len(folds)


def test_smooth_parabola_has_one_fold_at_pull_off():
    folds = WavyParabola(2.5, 0.0, 12.0, MODULUS, 0.05).folds(2.0)
    assert folds == pytest.approx([parabola_pull_off(2.5, MODULUS, 0.05)[0]], rel=1e-9)
