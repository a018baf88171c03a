"""Johnson's single wave against quadrature, identities and limits that it was not written from."""

import numpy as np
import pytest
from scipy.integrate import quad

from adhesis.solver.references.parabola import parabola_load
from adhesis.solver.references.single_wave import SingleWave

A, PERIOD, MODULUS = 0.7, 3.0, 2.0  # any numbers: the closed form has one group, α
ALPHAS = (0.0, 0.05, 0.3, 0.6)

# a_in/λ, s_out/A, p_out/p*, loss/(A p*) in the flat measure: computed apart from this package with
# 30 digits (fold and touch by bisection, the loss by quadrature of p̄ ds), rounded once.
TABLE = {
    0.05: (0.037723603465, 1.05354152844, -0.00780966411167, 0.00036104211616506),
    0.10: (0.0584078476721, 1.11707634568, -0.0189850509882, 0.0020893524976455),
    0.20: (0.0897345852974, 1.25204901072, -0.0454100474847, 0.012018194079616),
    0.30: (0.114774204187, 1.39170871811, -0.0748594183937, 0.033348686406982),
    0.40: (0.136222076533, 1.53372480461, -0.106127600457, 0.068696764813953),
    0.50: (0.155174403011, 1.67715454369, -0.138625182443, 0.12020691068568),
    0.60: (0.172208354231, 1.82151756621, -0.172009243314, 0.18970542894512),
}


def wave(alpha: float, measure: str = "flat", amplitude: float = A) -> SingleWave:
    return SingleWave.with_alpha(alpha, amplitude, PERIOD, MODULUS, measure)


def derivative(function, x: float, step: float) -> float:
    """Fourth-order central difference."""
    f = [float(function(x + k * step)) for k in (-2, -1, 1, 2)]
    return (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)


def contact_integral(w: SingleWave, a: float, weight=lambda x: 1.0) -> float:
    """∫ σ(x) weight(x) dx over the contact, x = a sin θ so that the edge singularity is removed."""

    def integrand(theta: float) -> float:
        x = a * np.sin(theta)
        return float(w.stress(x, a)) * weight(x) * a * np.cos(theta)

    return quad(integrand, -np.pi / 2, np.pi / 2, epsabs=1e-13, epsrel=1e-12, limit=200)[0]


def stress_intensity(w: SingleWave, a):
    """K in Pa·sqrt(m) at the edges of a contact in equilibrium."""
    return w.adhesive_tension(a) * np.sqrt(PERIOD / np.tan(np.pi * a / PERIOD))


@pytest.mark.parametrize("alpha", TABLE)
def test_loop_is_the_tabulated_one_to_every_printed_digit(alpha):
    w = wave(alpha)
    loop, p_star = w.loop, w.full_contact_stress
    assert w.alpha == pytest.approx(alpha, rel=1e-14)
    exact = (
        loop.touch_half_width / PERIOD,
        loop.fold_separation / A,
        loop.fold_mean_stress / p_star,
        loop.loss / (A * p_star),
    )
    assert exact == pytest.approx(TABLE[alpha], rel=1e-11)


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("a", [0.1, 0.75, 1.4])
def test_stress_field_has_the_stated_mean_and_work_and_closes_the_gap(alpha, a):
    """The surface displaced by σ is the profile in contact and clears it by t outside.

    The elastic energy is half the work of σ.
    """
    w = wave(alpha)
    p, s = float(w.mean_stress(a)), float(w.separation(a))
    assert contact_integral(w, a) / PERIOD == pytest.approx(p, abs=1e-9)

    def displacement(x: float) -> float:
        # Zero-mean response of the half-space to a periodic line load; singular at its own x.
        def integrand(theta: float) -> float:
            xi = a * np.sin(theta)
            kernel = np.log(2 * abs(np.sin(np.pi * (x - xi) / PERIOD)) + 1e-300)
            return float(w.stress(xi, a)) * kernel * a * np.cos(theta)

        cuts = [np.arcsin(x / a)] if abs(x) < a else None
        integral = quad(integrand, -np.pi / 2, np.pi / 2, points=cuts, limit=300)[0]
        return -2 / (np.pi * MODULUS) * integral

    for x in (0.0, 0.4 * a, -0.9 * a, 0.5 * (a + PERIOD / 2), PERIOD / 2):
        h = A * np.cos(2 * np.pi * x / PERIOD)
        assert displacement(x) - h + s == pytest.approx(float(w.gap(x, a)), abs=2e-8)
    mean_gap = 2 / PERIOD * quad(lambda x: float(w.gap(x, a)), a, PERIOD / 2, epsabs=1e-12)[0]
    assert mean_gap == pytest.approx(s, abs=1e-9)
    by_quadrature = 0.5 * contact_integral(w, a, lambda x: A * np.cos(2 * np.pi * x / PERIOD) - s)
    assert float(w.elastic_energy_at(a, s)) == pytest.approx(by_quadrature, rel=1e-8)
    assert float(w.energy(a)) == pytest.approx(by_quadrature - 2 * a * w.work_of_adhesion, rel=1e-8)


def test_gap_is_zero_in_contact_for_every_half_width():
    x = PERIOD * np.linspace(0, 0.01, 5)
    for a in PERIOD * np.linspace(0.02, 0.49, 5000):
        assert (wave(0.2).gap(x, float(a)) == 0).all()


@pytest.mark.parametrize("measure", ["flat", "arc"])
@pytest.mark.parametrize("alpha", ALPHAS)
def test_equilibrium_is_griffiths_and_its_energy_the_work_of_the_mean_stress(alpha, measure):
    w = wave(alpha, measure)
    for a in np.linspace(0.05, 1.45, 15):
        s = float(w.separation(a))
        d = 2e-3 * min(a, PERIOD / 2 - a)
        slope = derivative(lambda b, s=s: w.energy_at(b, s), a, d)
        assert slope == pytest.approx(0.0, abs=1e-9 * w.energy_scale)
        h1 = w.steepest_slope * np.sin(2 * np.pi * a / PERIOD)
        gamma = w.work_of_adhesion * (np.sqrt(1 + h1**2) if measure == "arc" else 1.0)
        assert stress_intensity(w, a) ** 2 / (2 * MODULUS) == pytest.approx(gamma, abs=1e-13)
        # Stable at fixed separation where s falls with a growing contact.
        curve = float(w.energy_at(a + d, s) - 2 * w.energy_at(a, s) + w.energy_at(a - d, s))
        if abs(w.separation_slope(a)) > 1e-2:
            assert (curve > 0) == (float(w.separation_slope(a)) < 0)
        # dU/ds = -λ p̄, at fixed contact and along the branch
        force = -PERIOD * float(w.mean_stress(a))
        assert derivative(lambda z, a=a: w.energy_at(a, z), s, d) == pytest.approx(force, rel=1e-9)
        path = derivative(w.separation, a, d)
        assert path == pytest.approx(float(w.separation_slope(a)), rel=1e-8)
        assert derivative(w.energy, a, d) / path == pytest.approx(force, rel=1e-8)


def test_without_adhesion_it_is_westergaard():
    """Mean pressure p* sin²(πa/λ), Hertz-like peak, no edge singularity, no hysteresis."""
    w = wave(0.0)
    a = np.array([0.2, 0.9, 1.3])
    y = np.sin(np.pi * a / PERIOD) ** 2
    assert w.mean_stress(a) == pytest.approx(w.full_contact_stress * y, rel=1e-14)
    assert w.stress(0.0, a) == pytest.approx(2 * w.mean_stress(a) / np.sqrt(y), rel=1e-14)
    assert np.all(stress_intensity(w, a) == 0)
    assert (w.loop.loss, w.loop.fold_half_width, w.loop.fold_separation) == (0.0, 0.0, A)
    # Closing the wave takes p*: the contact is full there and the mean gap gone.
    nearly = PERIOD / 2 * (1 - 1e-6)
    assert float(w.separation(nearly)) == pytest.approx(0.0, abs=1e-10)


def test_no_state_beyond_full_contact_or_pull_off():
    w = wave(0.2)
    for s in (0.0, -0.1, 1.26 * A, np.nan):
        with pytest.raises(ValueError, match="stable contact needs"):
            w.half_width(s)
    for s in (1e-3 * A, 0.5 * A, A, 1.25 * A):
        assert float(w.separation(w.half_width(s))) == pytest.approx(s, rel=1e-12)


STIFFNESSES = (0.0, 0.1, 1.0, 10.0)  # in p*/A


@pytest.mark.parametrize("relative", STIFFNESSES)
@pytest.mark.parametrize("measure", ["flat", "arc"])
def test_drops_under_any_control_are_the_integral_along_the_branch(relative, measure):
    """Between touch and fold the loop encloses ∫ p̄ du (load control: ∫ p̄ dΔ and no more)."""
    wave = SingleWave.with_alpha(0.3, 2e-5, 1e-3, 1e6, measure)
    stiffness = relative * wave.full_contact_stress / wave.amplitude
    loop = wave.loop_under(stiffness)
    a = np.linspace(loop.fold_half_width, loop.touch_half_width, 20001)
    way = -wave.separation(a)
    if stiffness:
        way = way + wave.mean_stress(a) / stiffness
    assert loop.loss == pytest.approx(-np.trapezoid(wave.mean_stress(a), way), rel=1e-7)


def test_strong_adhesion_runs_to_full_contact_under_load():
    """p̄ = 0 has no root where α > max sin^1.5 ψ cos^0.5 ψ = 0.5699 (at ψ = 60°)."""
    assert SingleWave.with_alpha(0.569, 1e-6, 1e-3, 1e6).loop_under(0.0).loss > 0
    with pytest.raises(ValueError, match="stable contact needs"):
        SingleWave.with_alpha(0.5705, 1e-6, 1e-3, 1e6).loop_under(0.0)


@pytest.mark.parametrize("alpha", [1e-4, 1e-3, 1e-2, 0.05, 0.1])
def test_a_narrow_patch_first_comes_to_rest_near_the_half_width_without_load(alpha):
    """The length (16 Γ/(π κ²))^(1/3), by which seeds and errors of ``grid`` go, is a half-width."""
    w = wave(alpha)
    curvature = A * (2 * np.pi / PERIOD) ** 2
    b = (32 * w.work_of_adhesion / (np.pi * MODULUS * curvature**2)) ** (1 / 3)
    assert 0.85 < w.loop.touch_half_width / b < 0.96
    assert parabola_load(b, 1 / curvature, MODULUS, w.work_of_adhesion) == pytest.approx(
        0, abs=1e-9
    )
    assert 1.2 < w.loop.touch_drop * PERIOD / (w.work_of_adhesion * b) < 1.5
