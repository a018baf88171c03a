"""From heights to a period: what each step promises, on heights that are known."""

import numpy as np
import pytest
from numpy.polynomial.legendre import legval

from adhesis.solver.model.measured_profile import (
    band_limited,
    form_shares,
    one_period,
    polynomial_form,
    trace_spectrum,
    trusted_wavelength,
)
from adhesis.solver.model.profile import self_affine_profile

N, STEP = 1200, 1e-6
X = STEP * np.arange(N)
LENGTH = N * STEP


def rough(seed: int = 3) -> np.ndarray:
    """One period of 6 … 120 waves."""
    profile = self_affine_profile(0.8, period=LENGTH, n0=6, ratio=20, seed=seed, h_rms=1e-6)
    return profile.at(X)


@pytest.mark.parametrize("degree", [0, 1, 2, 4])
def test_a_polynomial_is_all_form_and_its_rest_has_none(degree: int) -> None:
    place = X / LENGTH - 0.4
    form = 1e-6 * sum((k + 1) * place**k for k in range(degree + 1))
    np.testing.assert_allclose(polynomial_form(form, degree), form, atol=1e-18)
    rest = rough() - polynomial_form(rough(), degree)
    np.testing.assert_allclose(polynomial_form(rest, degree), 0, atol=1e-18)
    with pytest.raises(ValueError, match="degree is -1"):
        polynomial_form(form, -1)


def test_shares_of_a_form_are_the_mean_squares_of_its_polynomials() -> None:
    form = legval(2 * X / X[-1] - 1, [1e-6, 2e-6, 3e-6])
    wanted = [1e-12, 4e-12 / 3, 9e-12 / 5, *10 * [0]]
    np.testing.assert_allclose(form_shares(form), wanted, rtol=1e-9, atol=1e-24)


def test_a_period_keeps_the_heights_and_has_no_step() -> None:
    z = rough() + 1e-3 * (X - X.mean())  # ends that do not meet
    steps = np.abs(np.diff(z)).max()
    for continuation in ("taper", "blend"):
        period, length = one_period(z, STEP, continuation, 0.05)
        assert np.abs(np.diff(period, append=period[0])).max() < 2 * steps, continuation
        assert length == pytest.approx(STEP * period.size)
    ends = round(0.05 * N)
    taper, _ = one_period(z, STEP, "taper", 0.05)
    np.testing.assert_array_equal(taper[ends:-ends], (z - z.mean())[ends:-ends])
    blend, length = one_period(z, STEP, "blend", 0.05)
    np.testing.assert_array_equal(blend[ends:], z[ends : N - ends])
    assert length == pytest.approx(0.95 * LENGTH)
    for part in (0.0, 0.5):
        with pytest.raises(ValueError, match="part is"):
            one_period(z, STEP, "blend", part)
    with pytest.raises(ValueError, match="continuation is 'knot'"):
        one_period(z, STEP, "knot")  # type: ignore[arg-type]


def test_blending_keeps_the_mean_square_height_and_tapering_does_not() -> None:
    """The ends of many rough traces, blended over 10 % or faded over 10 % on either side."""
    ratios = {"blend": [], "taper": []}  # type: dict[str, list[float]]
    for seed in range(40):
        z = rough(seed)
        for kind, found in ratios.items():
            period, _ = one_period(z, STEP, kind, 0.1)  # type: ignore[arg-type]
            found.append(float(np.mean(period**2) / np.mean(z**2)))
    assert np.mean(ratios["blend"]) == pytest.approx(1.0, abs=0.02)
    assert np.mean(ratios["taper"]) == pytest.approx(1 - 0.2 * 5 / 8, abs=0.02)


def test_the_band_is_cut_and_what_is_within_is_kept() -> None:
    kept = 1e-6 * np.cos(2 * np.pi * 3 * X / LENGTH) + 2e-7 * np.sin(2 * np.pi * 40 * X / LENGTH)
    gone = 1e-6 * np.sin(2 * np.pi * 41 * X / LENGTH)
    profile = band_limited(kept + gone, LENGTH, LENGTH / 40)
    assert profile.highest_harmonic == 40
    np.testing.assert_allclose(profile.heights(N), kept, atol=1e-18)
    with pytest.raises(ValueError, match="do not hold waves"):
        band_limited(kept, LENGTH, 2 * STEP)
    with pytest.raises(ValueError, match="no wave of"):
        band_limited(kept, LENGTH, 2 * LENGTH)


def test_the_spectrum_has_the_mean_square_and_finds_the_noise() -> None:
    noise = 2e-8 * np.random.default_rng(1).standard_normal(N)
    spectrum = trace_spectrum(rough() + noise, STEP)
    q, power = spectrum.wave_number, spectrum.power
    total = np.sum((power[1:] + power[:-1]) * np.diff(q)) / (2 * np.pi)
    assert total == pytest.approx(1e-12, rel=0.2)
    assert spectrum.noise == pytest.approx(2e-8, rel=0.1)
    # Roughness down to the step levels out nowhere: it is not taken for noise.
    whole = self_affine_profile(0.8, period=LENGTH, n0=6, ratio=99, seed=1, h_rms=1e-6).at(X)
    assert trace_spectrum(whole, STEP).noise == 0


def test_what_limits_the_shortest_wave() -> None:
    noise = 2e-8 * np.random.default_rng(1).standard_normal(N)
    spectrum = trace_spectrum(rough() + noise, STEP)
    limits = trusted_wavelength(spectrum, STEP, 0.0)
    assert limits["step"] == pytest.approx(5e-6)
    assert limits["tip"] == 0
    assert 8e-6 < limits["noise"] < 14e-6  # the waves end at 10 µm
    # A curvature of 1/(2R) at 25 µm: the tip that can be trusted down to there and no further.
    profile = self_affine_profile(0.8, period=LENGTH, n0=6, ratio=20, seed=3, h_rms=1e-6)
    m = np.arange(profile.coefficients.size)
    wave = (profile.q0 * m) ** 4 * np.abs(profile.coefficients) ** 2
    radius = 0.5 / np.sqrt(2 * wave[: round(LENGTH / 25e-6) + 1].sum())
    assert trusted_wavelength(spectrum, STEP, radius)["tip"] == pytest.approx(25e-6, rel=0.15)
    sharper = trusted_wavelength(spectrum, STEP, radius / 100)["tip"]
    assert sharper < 10e-6
