"""Quantities with units: read from options and campaign files by one reader, and printed."""

import argparse
from math import inf, nan

import pytest

from adhesis.ensemble.campaign.file import parse_campaign
from adhesis.ensemble.command.main import parser_of
from adhesis.ensemble.command.options import turns_of
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.quantities import (
    HEIGHT,
    LENGTH,
    QUANTITIES,
    STIFFNESS,
    STRESS,
    WORK_OF_ADHESION,
    Quantity,
    bytes_text,
    percent,
    rounded_percent,
    stress_text,
    with_error,
)
from adhesis.solver.model.control import Control
from tests.support.campaign_support import campaign_text

READ: list[tuple[Quantity, str, float]] = [
    *((LENGTH, "1e-6", 1e-6), (LENGTH, "0.5", 0.5), (LENGTH, "-1e-3", -1e-3)),
    *((LENGTH, "2.5um", 2.5e-6), (LENGTH, "7 µm", 7e-6), (LENGTH, "7μm", 7e-6)),
    *((LENGTH, "3e0kÅ", 3e-7), (LENGTH, " .5 mm ", 5e-4), (LENGTH, "1 inch", 0.0254)),
    *((STRESS, "20kPa", 2e4), (STRESS, "inf", inf), (WORK_OF_ADHESION, "20 mN / m", 0.02)),
    *((WORK_OF_ADHESION, "20mJ/m2", 0.02), (WORK_OF_ADHESION, "40J/m^2", 40.0)),
    # heights of a metre are asked about: below; what is no number is left to its rule
    *((HEIGHT, "1e-3", 1e-3), (HEIGHT, "10m", 10.0), (LENGTH, "inf", inf), (HEIGHT, "nan", nan)),
]
LENGTHS, WORKS = "m, cm, mm, µm, nm, Å, inch", "J/m², mJ/m², N/m, mN/m"
IS_WORK = "it must be a number in J/m² with a decimal point, as in 0.02, or with"
REFUSED: list[tuple[Quantity, str, str]] = [
    (LENGTH, "", "is '': it must be a length, as in 5e-6 (m) or 0.5um"),
    (LENGTH, "5 parsec", f"is '5 parsec': its unit must be one of {LENGTHS}"),
    (LENGTH, "9" * 400 + "x", "…': its unit must be one of m, cm"),
    (LENGTH, "20", 'would be 20 m: give its unit, as in "20um" ("20m", if metres are meant)'),
    (HEIGHT, "0.4", "is 0.4, which would be 0.4 m: give"),
    (STRESS, "1mPa", "is '1mPa': its unit must be one of Pa, kPa, MPa, GPa"),  # no thousandth
    (WORK_OF_ADHESION, "20", 'which would be 20 J/m²: give its unit, as in "20mJ/m2" ("20J'),
    (WORK_OF_ADHESION, "20mJ", f"is '20mJ': {IS_WORK}"),
    (WORK_OF_ADHESION, "0,02", f"is '0,02': {IS_WORK}"),
    (WORK_OF_ADHESION, "20J/m", f"its unit must be one of {WORKS}"),
    (WORK_OF_ADHESION, "20Nm", "it must be a number in J/m²"),
]


@pytest.mark.parametrize(("quantity", "text", "value"), READ)
def test_a_quantity_is_the_number_nearest_to_its_decimals(quantity, text, value) -> None:
    """So that 7um has the bits of 7e-6, and the same loss."""
    assert repr(quantity.option(text)) == repr(value)


@pytest.mark.parametrize(("quantity", "text", "sentence"), REFUSED)
def test_what_is_no_quantity_is_refused_with_the_rule(quantity, text, sentence) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as refusal:
        quantity.option(text)
    assert sentence in str(refusal.value)
    assert len(str(refusal.value)) < 220


@pytest.mark.parametrize("quantity", [*QUANTITIES.values(), HEIGHT], ids=lambda q: q.name)
def test_a_quantity_is_read_in_each_of_its_units(quantity: Quantity) -> None:
    """An option, a list and a key of a campaign file know the same ones."""
    for unit, size in quantity.units.items():
        for text in (f"3{unit}", f" 3 {unit} ", f"3e0 {unit.replace('/', ' / ')}"):
            assert quantity.option(text) == pytest.approx(3 * size, rel=1e-15)
    with pytest.raises(InputError, match=f"its unit must be one of {', '.join(quantity.units)}$"):
        quantity.read("3 " + ("pounds/m2" if "/" in quantity.unit else "pounds"))
    assert quantity.read_with_unit(quantity.example) > 0


def test_blanks_within_a_unit_and_raised_digits_make_no_quantity() -> None:
    assert LENGTH.read("２．５ ㎛") == 2.5e-6
    for text in ("5 m m", "5 k Pa", "2² mm", "²2 mm", "2½ mm"):
        with pytest.raises(InputError, match="it must be a"):
            (STRESS if "Pa" in text else LENGTH).read(text)
    with pytest.raises(InputError, match="unit is 'm m': it must be one of m, cm"):
        LENGTH.unit_named("m m")


def test_keys_of_a_campaign_take_quantities_with_units() -> None:
    units = parse_campaign(campaign_text(period='"1 mm"', h_rms='"1 µm"', young='"1 MPa"'))
    assert units == parse_campaign(campaign_text(period="1e-3", h_rms="1e-6", young="1e6"))
    several = parse_campaign(campaign_text(h_rms='["1 µm", 2e-6]'))
    assert several.lists == {"profile.h_rms": (1e-6, 2e-6)}
    # without its unit it is asked about (test_campaign.py)
    text = campaign_text(period='"1000 m"', work_of_adhesion='["40J/m2"]')
    assert parse_campaign(text).sweep.work_of_adhesion == (40.0,)


def test_turning_points_under_a_load_are_stresses_with_units() -> None:
    parser = parser_of("loop")
    args = parser.parse(["--stiffness", "0", "--max-stress", "0.2kPa,500Pa, 1e-3MPa"])
    assert turns_of(args, Control(0.0))["turning_points"] == (200.0, 500.0, 1000.0)


def test_quantities_are_shown_in_a_unit_of_their_size() -> None:
    texts = [stress_text(pascals) for pascals in (0.0, 1.5, 999.9, 2e4, -3e6, 2.5e9)]
    assert texts == ["0 Pa", "1.5 Pa", "1 kPa", "20 kPa", "-3 MPa", "2.5 GPa"]
    assert LENGTH.text(0.99999e-6) == "1 µm"
    assert STIFFNESS.text(1e9) == "1e+09 Pa/m"


def test_a_share_is_shown_in_percent_without_an_exponent() -> None:
    assert percent(1.234) == "120 %"
    assert percent(0.0123, 0.5) == "1.2 to 50 %"
    assert percent(1.234, digits=3) == "123 %"
    assert [rounded_percent(share, sign="+") for share in (0.03, -0.0123, -1e-5)] == [
        *("+3.0 %", "-1.2 %", "0.0 %")
    ]


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ((9705.0, 19317.0), "10000, from 0 to 29000"),
        ((9705.0, 612.0), "9700 ± 600"),
        ((1.41, 32.0), "1.4, from 0 to 30"),
        ((2500.0, 30000.0), "2500, from 0 to 30000"),
        ((35.12, 4.2), "35 ± 4"),
        ((0.03512, 0.00123), "0.0351 ± 0.0012"),
        ((-3.0, 0.96), "-3.0 ± 1.0"),
        ((-1e-13, 4e-9), "0.000000000 ± 0.000000004"),
        ((4.0, 1e-12), "4 ± 1e-12"),
        ((4.0, 0.0), "4 ± 0"),
        ((4.0, inf), "4 ± inf"),
        ((4.0, nan), "4 ± nan"),
        # of a fraction of contact: more than 1 is not printed, unless it was given
        ((0.995, 0.020, 1), "0.995, from 0.975 to 1.000"),
        ((0.6, 0.7, 1), "0.6, from 0.0 to 1.0"),
        ((0.5, 0.112, 1), "0.50 ± 0.11"),
        ((1.0, 0.0, 1), "1 ± 0"),
        ((0.98, 0.02, 1), "0.980 ± 0.020"),
        ((1.2, 0.112, 1), "1.20 ± 0.11"),
    ],
)
def test_a_value_has_the_digits_of_its_error_and_its_interval_keeps_to_its_bounds(values, text):
    assert with_error(*values) == text


def test_a_small_size_is_not_zero() -> None:
    assert [bytes_text(size) for size in (0, 345_678, 12_345_678, 65_600_000_000)] == [
        *("0 kB", "346 kB", "12 MB", "65.6 GB")
    ]
