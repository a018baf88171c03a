"""Preparing a trace: each step does what it says, says what it does, and refuses the rest."""

from __future__ import annotations

import ast
import re

import numpy as np
import pytest

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.quantities import LENGTH
from adhesis.ensemble.trace.prepare import Prepared, prepare_trace
from adhesis.ensemble.trace.reading.measured_trace import Trace
from adhesis.solver.model.profile import self_affine_profile

N, STEP = 1600, 1e-6
X = STEP * np.arange(N)
PROFILE = self_affine_profile(0.8, period=N * STEP, n0=5, ratio=32, seed=5, h_rms=1e-6)
Z = PROFILE.at(X)
PLACE = 2 * X / X[-1] - 1


def prepared(heights: np.ndarray, **options: object) -> Prepared:
    return prepare_trace(Trace(heights, STEP, "t.txt"), **options)  # type: ignore[arg-type]


def said(found: Prepared, name: str) -> str:
    return " ".join(step.description for step in found.steps if step.name == name)


def outliers(found: Prepared) -> float:
    return sum(step.numbers["points"] for step in found.steps if step.name == "outliers")


def test_a_tilt_goes_and_a_clean_trace_stays() -> None:
    found = prepared(Z + 3e-3 * X)
    assert found.degree == 1
    assert found.warnings == ()
    np.testing.assert_allclose(found.level(), prepared(Z).level(), atol=1e-17)
    assert outliers(found) == 0
    assert not found.gaps.any()


def test_a_radius_of_curvature_is_taken_off_and_said() -> None:
    """A cylinder of 0.1 m: 3.2 µm from the middle to the ends."""
    found = prepared(Z + 3e-3 * X - (X - X.mean()) ** 2 / (2 * 0.1))
    assert found.degree == 2
    assert "bow" in said(found, "form")
    assert "stands out" in said(found, "form")
    np.testing.assert_allclose(found.level(), prepared(Z, degree=2).level(), atol=1e-15)
    # 1.9 mm of bow as well: nothing of it is left.
    huge = prepared(Z - 1.9e-3 * PLACE**2)
    np.testing.assert_allclose(huge.level(), prepared(Z, degree=2).level(), atol=1e-13)


def test_heights_that_an_instrument_held_or_cut_off_are_warned_of() -> None:
    held = Z.copy()
    held[700:720] = Z[700]
    noisy = Z + np.random.default_rng(0).normal(0.0, 3e-7, N)
    in_short_rows = np.clip(noisy, *np.quantile(noisy, (0.1, 0.9)))
    for heights in (held, np.minimum(Z, np.sort(Z)[-60]), in_short_rows):
        (warning,) = prepared(heights).warnings
        assert "heights in a row from" in warning
    assert "20 heights in a row from 700 µm on" in prepared(held).warnings[0]
    assert prepared(np.round(Z, 7)).warnings == ()  # of a coarse digit many neighbours are equal


def test_a_form_that_stays_by_order_is_warned_of() -> None:
    found = prepared(Z + 3e-6 * PLACE**2, degree=1)
    assert found.degree == 1
    assert any("a form of degree 2 remains" in warning for warning in found.warnings)
    with pytest.raises(InputError, match="degree is 7"):
        prepared(Z, degree=7)


def test_drop_outs_are_interpolated_up_to_a_length() -> None:
    heights = Z.copy()
    heights[100] = heights[200:204] = np.nan
    found = prepared(heights)
    assert np.flatnonzero(found.gaps).tolist() == [100, 200, 201, 202, 203]
    assert found.filled[100] == pytest.approx((Z[99] + Z[101]) / 2)
    assert "5 heights" in said(found, "drop-outs")
    assert "2 gaps" in said(found, "drop-outs")
    assert said(found, "drop-outs").endswith("the longest over 5 µm")
    heights[300:400] = np.nan
    with pytest.raises(InputError, match=r"gap of 101 µm at 300 µm: up to 16 µm is interpolated"):
        prepared(heights)
    assert prepared(heights, longest_gap=110e-6).gaps.sum() == 105
    heights = Z.copy()
    heights[1:-1:6] = np.nan
    with pytest.raises(InputError, match=r"lacks 16\.\d % of its heights"):
        prepared(heights)


def test_missing_ends_are_cut_off() -> None:
    heights = Z.copy()
    heights[:7] = heights[-3:] = np.nan
    found = prepared(heights)
    assert found.filled.size == N - 10
    assert "10" in said(found, "ends")


def test_dust_is_taken_out_and_crests_are_not() -> None:
    heights = Z.copy()
    heights[[333, 700, 701]] += 15e-6
    heights[900] -= 10e-6
    found = prepared(heights)
    assert outliers(found) == 4
    assert np.flatnonzero(found.gaps).tolist() == [333, 700, 701, 900]
    assert np.abs(found.filled - Z).max() < 2e-7
    assert outliers(prepared(heights, keep_outliers=True)) == 0
    # Sharp crests of a saw, and edges of steps, are the surface's own.
    saw = 1e-6 * np.abs((X / 50e-6) % 2 - 1)
    assert outliers(prepared(saw)) == 0
    steps = 1e-6 * np.sign(np.sin(2 * np.pi * X / 80e-6 + 0.1))
    noise = 1e-9 * np.random.default_rng(0).standard_normal(N)
    assert outliers(prepared(steps + noise)) == 0
    spiky = Z + 20e-6 * (np.random.default_rng(0).random(N) < 0.04)
    many = prepared(spiky, cut_off=20e-6)
    assert outliers(many) == 0
    assert any("too many for outliers" in warning for warning in many.warnings)


def test_the_cut_off_is_proposed_given_or_refused() -> None:
    assert prepared(Z).cut_off == pytest.approx(5e-6)
    assert "five steps" in said(prepared(Z), "cut-off")
    noisy = prepared(Z + 3e-8 * np.random.default_rng(2).standard_normal(N))
    assert noisy.cut_off > 6e-6
    assert "noise" in said(noisy, "cut-off")
    blunt = prepared(Z, tip_radius=100e-6)
    assert blunt.cut_off > 10e-6
    assert "tip of radius 100 µm" in said(blunt, "cut-off")
    assert any("shorter than what" in w for w in prepared(Z, cut_off=3e-6).warnings)
    for cut_off in (1e-6, 1e-3):
        with pytest.raises(InputError, match="cut_off is"):
            prepared(Z, cut_off=cut_off)
    with pytest.raises(InputError, match="no roughness above its noise"):
        prepared(1e-9 * np.random.default_rng(0).standard_normal(N))


def test_a_tip_radius_that_is_given_goes_before_that_of_the_file() -> None:
    """So does a radius of 0, which is none: the file may name the radius of a new tip."""
    trace = Trace(Z, STEP, "t.txt", tip_radius=100e-6)
    radii = (None, 200e-6, 100e-6, 50e-6, 0.0)
    limits = [prepare_trace(trace, tip_radius=radius).limits["tip"] for radius in radii]
    assert limits[1] > limits[2] > limits[3] > limits[4] == 0.0
    assert limits[0] == limits[2]


def test_long_waves_that_decide_alone_are_warned_of() -> None:
    found = prepared(Z + 4e-6 * np.sin(2 * np.pi * X / X[-1]), degree=1)
    assert any("waves longer than a third" in warning for warning in found.warnings)
    assert not any("waves longer" in warning for warning in prepared(Z).warnings)


def test_heights_can_be_turned_over() -> None:
    np.testing.assert_allclose(prepared(Z, invert=True).level(), -prepared(Z).level(), atol=1e-18)


def test_the_profile_is_the_trace() -> None:
    """Within the trace, away from what is blended, and up to the waves that are cut off."""
    found = prepared(Z + 2e-3 * X)
    x = X[200:1400]
    used = found.profile().at(x)
    level = found.level()[200:1400]
    np.testing.assert_allclose(used - used.mean(), level - level.mean(), atol=2e-8)


RIDGE = 9e-6 * np.exp(-(((X - 0.7e-3) / 8e-6) ** 2))


def test_an_excluded_range_is_bridged_whatever_its_length() -> None:
    """It is a drop-out that no rule for the length of gaps refuses, and it is reported."""
    found = prepared(Z + RIDGE, exclude=[(670e-6, 730e-6)])
    inside = (X >= 670e-6 - 1e-12) & (X <= 730e-6 + 1e-12)
    assert np.array_equal(found.gaps, inside)
    np.testing.assert_allclose(np.diff(found.filled[inside], n=2), 0, atol=1e-18)
    np.testing.assert_array_equal(found.filled[~inside], (Z + RIDGE)[~inside])
    assert said(found, "excluded") == (
        "670 µm to 730 µm, as given: 61 heights treated as drop-outs"
    )
    assert "61 heights" in said(found, "drop-outs")
    assert found.excluded == ((670e-6, 730e-6),)
    assert found.features == found.warnings == ()


def test_drop_outs_beside_an_excluded_range_count_alone() -> None:
    heights = Z.copy()
    heights[731:760] = np.nan
    with pytest.raises(InputError, match="gap of 30 µm at 670 µm: up to 16 µm is interpolated"):
        prepared(heights, exclude=[(670e-6, 730e-6)])
    heights[735:] = Z[735:]
    assert prepared(heights, exclude=[(670e-6, 730e-6)]).gaps.sum() == 65


def test_what_is_excluded_at_an_end_is_cut_off_and_positions_stay() -> None:
    heights = Z + RIDGE
    heights[:100] = np.nan
    found = prepared(heights, exclude=[(1.5e-3, 1.0)])
    assert (found.filled.size, found.start) == (1400, pytest.approx(100e-6))
    (feature,) = found.features
    assert feature.position == pytest.approx(700e-6, abs=2e-6)
    kept = found.level(without_features=True)
    assert kept.max() < found.level().max() - 6e-6


@pytest.mark.parametrize(("sign", "word"), [(1.0, "crest"), (-1.0, "trough")])
def test_a_feature_far_out_of_all_others_is_warned_of_with_what_leaves_it_out(sign, word):
    found = prepared(Z + sign * RIDGE)
    (feature,) = found.features
    assert feature.is_crest == (sign > 0)
    assert feature.position == pytest.approx(700e-6, abs=2e-6)
    assert feature.begin < 685e-6 < 715e-6 < feature.end
    (warning,) = found.warnings
    assert f"a single {word} at 70" in warning
    range_text = warning.partition("exclude=")[2]
    again = prepared(Z + sign * RIDGE, exclude=ast.literal_eval(range_text))
    assert again.features == again.warnings == ()


def test_two_features_of_one_height_are_found_together() -> None:
    found = prepared(Z + RIDGE + np.roll(RIDGE, 500))
    assert [round(1e6 * one.position, -1) for one in found.features] == [700, 1200]


def test_crests_of_roughness_are_no_single_features() -> None:
    """The highest of many is never so far out; measured over thousands: less than 1 %."""
    count = 0
    for seed in range(100):
        profile = self_affine_profile(
            0.3 + 0.006 * seed, period=N * STEP, n0=4, ratio=60, seed=seed, h_rms=1e-6
        )
        count += bool(prepared(profile.at(X)).features)
    assert count == 0


def test_lengths_that_a_refusal_names_are_taken() -> None:
    """Half the length was refused as beyond itself: "it must lie between … and 199.875 µm"."""
    gappy = Z.copy()
    gappy[100:140] = np.nan
    for step in (1e-6 / 3, 0.5e-6, 0.9e-6, 1e-6 / 7):
        for heights, name, given in (
            (Z, "cut_off", 1e-12),
            (Z, "cut_off", 0.5),
            (gappy, "longest_gap", 1e-9),
        ):
            trace = Trace(heights, step, "t.txt")
            with pytest.raises(InputError) as refusal:
                prepare_trace(trace, **{name: given})  # type: ignore[arg-type]
            named = re.findall(r"[\d.]+ [µn]m", str(refusal.value).removeprefix("cut_off is "))
            shown = named[-1] if given == 0.5 else named[0] if name == "longest_gap" else named[-2]
            prepare_trace(trace, **{name: LENGTH.read(shown)})  # type: ignore[arg-type]
