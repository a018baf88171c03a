"""Profiles: the spectral method, given heights, statistics and transformations."""

import numpy as np
import pytest

from adhesis import Profile, profile_from_heights
from adhesis import self_affine_profile as spectral

ROUGH = {"period": 2e-3 * np.pi, "n0": 10, "ratio": 20, "seed": 3}


@pytest.fixture(scope="module")
def rough() -> Profile:
    return spectral(0.8, h_rms=1e-6, **ROUGH)


def test_power_law_and_band(rough):
    size = np.abs(rough.coefficients)
    assert not size[:10].any()
    m = np.arange(10, 201)
    np.testing.assert_allclose(size[10:] ** 2 / size[10] ** 2, (m / 10.0) ** -2.6, rtol=1e-12)
    assert rough.highest_harmonic == 200
    assert rough.shortest_wavelength == pytest.approx(rough.period / 200)


def test_statistics_are_those_of_the_nodes(rough):
    n = 1024
    assert rough.h_rms == pytest.approx(1e-6, rel=1e-14)
    assert np.mean(rough.heights(n) ** 2) == pytest.approx(rough.m0, rel=1e-12)
    assert np.mean(rough.slopes(n) ** 2) == pytest.approx(rough.m2, rel=1e-12)
    assert np.mean(rough.curvatures(n) ** 2) == pytest.approx(rough.m4, rel=1e-12)
    assert abs(rough.heights(n).mean()) < 1e-20


@pytest.mark.parametrize("norm", [{"h_rms": 2e-6}, {"m2": 3e-3}, {"c0": 1e-14}])
@pytest.mark.parametrize("amplitudes", ["deterministic", "rayleigh"])
def test_normalisations(norm, amplitudes):
    profile = spectral(0.7, amplitudes=amplitudes, **norm, **ROUGH)
    ((name, value),) = norm.items()
    if name == "c0":
        if amplitudes == "deterministic":
            assert abs(profile.coefficients[10]) ** 2 == pytest.approx(value, rel=1e-12)
    else:
        assert getattr(profile, name) == pytest.approx(value, rel=1e-12)


def test_wider_spectrum_keeps_the_waves_it_had():
    narrow = spectral(0.8, c0=1e-14, **ROUGH)
    wide = spectral(0.8, c0=1e-14, **{**ROUGH, "ratio": 40})
    np.testing.assert_allclose(wide.coefficients[:201], narrow.coefficients, rtol=1e-14)
    phase = np.angle(wide.coefficients[10:])
    assert phase.min() < -3
    assert phase.max() > 3
    other = spectral(0.8, c0=1e-14, **{**ROUGH, "seed": 4})
    assert not np.allclose(np.angle(other.coefficients[10:50]), phase[:40])


@pytest.mark.parametrize("amplitudes", ["deterministic", "rayleigh"])
def test_a_spectrum_that_begins_earlier_keeps_the_waves_it_had(amplitudes):
    """Phase and Rayleigh amplitude of a wave depend on its number and the seed alone."""
    late = spectral(0.8, c0=1e-14, amplitudes=amplitudes, **ROUGH)
    earlier = {**ROUGH, "n0": 5, "ratio": 40}
    early = spectral(0.8, c0=1e-14 * 2**2.6, amplitudes=amplitudes, **earlier)
    np.testing.assert_allclose(early.coefficients[10:], late.coefficients[10:], rtol=1e-12)
    assert early.coefficients[5:10].all()


def test_a_rolloff_is_flat_and_keeps_the_longest_wave():
    power = np.abs(spectral(0.8, c0=1e-14, rolloff=4.0, **ROUGH).coefficients) ** 2
    np.testing.assert_allclose(power[10:41], 1e-14, rtol=1e-12)
    m = np.arange(40, 201)
    np.testing.assert_allclose(power[40:], 1e-14 * (m / 40.0) ** -2.6, rtol=1e-12)


def test_finer_grid_is_the_same_function(rough):
    np.testing.assert_allclose(rough.heights(4096)[::8], rough.heights(512), atol=1e-20)
    x = np.arange(512) * rough.period / 512
    np.testing.assert_allclose(rough.at(x), rough.heights(512), atol=1e-18)
    np.testing.assert_allclose(rough.at(x, 1), rough.slopes(512), atol=1e-14)
    np.testing.assert_allclose(rough.at(x, 2), rough.curvatures(512), rtol=1e-9, atol=1e-9)
    with pytest.raises(ValueError, match="more than 400 nodes"):
        rough.heights(400)


def test_highest_point_is_that_of_the_continuous_function(rough):
    x, top = rough.highest_point
    fine = rough.heights(1 << 17)
    assert top >= fine.max()
    assert top - fine.max() < 1e-6 * top
    assert float(rough.at(x)) == pytest.approx(top, rel=1e-14)
    assert abs(float(rough.at(x, 1))) < 1e-10


def test_transformations(rough):
    d = 3 * rough.period / 1024
    shifted = rough.shifted(d).heights(1024)
    np.testing.assert_allclose(shifted, np.roll(rough.heights(1024), 3), atol=1e-18)
    mirrored = rough.mirrored().heights(1024)
    np.testing.assert_allclose(mirrored, np.roll(rough.heights(1024)[::-1], 1), atol=1e-18)
    scaled = rough.scaled(2.0, 3.0)
    assert (scaled.period, scaled.h_max) == (3 * rough.period, pytest.approx(2 * rough.h_max))
    assert scaled.m2 == pytest.approx(rough.m2 * 4 / 9, rel=1e-12)


@pytest.mark.parametrize("n", [3, 64, 101])
def test_given_heights_are_passed_through(n):
    heights = np.random.default_rng(n).standard_normal(n) * 1e-6 + 5e-6
    profile = profile_from_heights(heights, 1e-3)
    x = np.arange(n) * 1e-3 / n
    np.testing.assert_allclose(profile.at(x), heights - heights.mean(), atol=1e-19)
    with pytest.raises(ValueError, match="the profile is flat"):
        profile_from_heights(np.full(n, 2e-6), 1e-3)


def test_crests_are_the_maxima_of_the_continuous_function(rough):
    crests = rough.crests(0.5)
    fine = rough.heights(1 << 16)
    peak = (fine > np.roll(fine, 1)) & (fine > np.roll(fine, -1)) & (fine >= 0.5 * rough.h_max)
    x = np.flatnonzero(peak) * rough.period / (1 << 16)
    assert crests.height.size > 5
    np.testing.assert_allclose(crests.position, x, rtol=0, atol=rough.period / (1 << 16))
    np.testing.assert_allclose(rough.at(crests.position, 1), 0, atol=1e-12)
    np.testing.assert_allclose(crests.curvature, -rough.at(crests.position, 2), rtol=1e-12)
    assert rough.crests().height.tolist() == [rough.h_max]


@pytest.mark.parametrize("shift", [0.0, 0.123456])
def test_equal_crests_are_found_together(shift):
    a = np.zeros(6, dtype=complex)
    a[5] = 5e-7
    equal = Profile(1e-3, a).shifted(shift * 1e-3)
    assert equal.crests().position.size == 5
    a[1] = 5e-7 * 1e-6  # crests differ by a millionth
    unequal = Profile(1e-3, a)
    assert unequal.crests().position.size == 1
    assert unequal.crests(1e-5).position.size == 5


def test_a_crest_without_curvature_is_found():
    """Cos x - cos(2x)/4 is 3/4 - x⁴/8 near its crest."""
    flat_top = Profile(1e-3, np.array([0, 0.5, -0.125]) * 1e-6)
    x, height = flat_top.highest_point
    assert height == pytest.approx(0.75e-6, rel=1e-12)
    assert min(x, 1e-3 - x) < 1e-4 * 1e-3
