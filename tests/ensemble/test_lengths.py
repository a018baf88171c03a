"""Lengths and stresses with their units: of options and of campaign files, by one reader."""

from __future__ import annotations

import argparse
import re
from math import inf
from pathlib import Path

import pytest

from adhesis.ensemble.campaign.file import load_campaign, parse_campaign
from adhesis.ensemble.command.main import COMMANDS, main, parser_of
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.loop.cycle import turns_of
from adhesis.ensemble.quantities import (
    HEIGHT,
    LENGTH,
    QUANTITIES,
    STIFFNESS,
    STRESS,
    WORK_OF_ADHESION,
    Quantity,
    percent,
    rounded_percent,
    stress_text,
)
from adhesis.solver.model.control import Control
from tests.support.campaign_support import campaign_text

READ = {
    "1e-6": 1e-6,
    "0.5": 0.5,
    "-1e-3": -1e-3,
    "2.5um": 2.5e-6,
    "7 µm": 7e-6,
    "7μm": 7e-6,
    "3e2nm": 3e-7,
    " .5 mm ": 5e-4,
    "12m": 12.0,
    "-1um": -1e-6,
    "1 inch": 0.0254,
}
REFUSED = {
    "": "is '': it must be a length, as in 5e-6 (m) or 5um",
    "um": "is 'um': it must be a length",
    "5 parsec": "is '5 parsec': its unit must be one of m, cm, mm, µm, nm, Å, inch",
    "1,5mm": "is '1,5mm': it must be a length",
    "5um5": "is '5um5': it must be a length",
    "9" * 400 + "x": "…': its unit must be one of m, cm",
    "20": "is 20, which would be 20 m: give its unit, as in 20um (20m, if metres are meant)",
}


@pytest.mark.parametrize("text", READ)
def test_a_length_is_the_number_nearest_to_its_decimals(text: str) -> None:
    """So that 7um has the bits of 7e-6, and the same loss."""
    assert LENGTH.option(text) == READ[text]


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_no_length_is_refused_with_the_rule(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as refusal:
        LENGTH.option(text)
    assert REFUSED[text] in str(refusal.value)
    assert len(str(refusal.value)) < 220


def test_heights_of_a_metre_are_asked_about_and_a_nan_is_left_to_its_rule() -> None:
    assert HEIGHT.option("1e-3") == 1e-3
    assert HEIGHT.option("10m") == 10.0
    with pytest.raises(argparse.ArgumentTypeError, match=r"is 0\.4, which would be 0\.4 m: give"):
        HEIGHT.option("0.4")
    assert HEIGHT.option("nan") != HEIGHT.option("nan")
    assert LENGTH.option("inf") == float("inf")


# Options that are numbers, but no quantities.
NUMBERS = {
    *("--hurst", "--m2", "--c0", "--poisson"),
    *("--accuracy", "--field-penetrations", "--budget"),
}


def test_every_option_that_is_a_quantity_takes_a_unit() -> None:
    actions = [action for name in COMMANDS for action in parser_of(name)._actions]
    options: dict[object, set[str]] = {}
    for action in actions:
        if action.option_strings:
            options.setdefault(action.type, set()).add(action.option_strings[-1])
    assert options[HEIGHT.option] == {"--h-rms"}
    lengths = {"--period", "--step", "--cut-off", "--tip-radius", "--longest-gap", "--layer"}
    assert options[LENGTH.option] == lengths | {"--adhesion-range"}
    assert options[STRESS.option] == {"--young", "--strength", "--field-stresses"}
    # and --max-stress and --preload, lists
    assert options[STIFFNESS.option] == {"--stiffness"}
    assert options[WORK_OF_ADHESION.option] == {"--work-of-adhesion", "--work-of-adhesion-open"}
    assert options[float] == NUMBERS


@pytest.mark.parametrize("quantity", [*QUANTITIES.values(), HEIGHT], ids=lambda q: q.name)
def test_a_quantity_is_read_in_each_of_its_units(quantity: Quantity) -> None:
    """An option, a list and a key of a campaign file know the same ones."""
    for unit, size in quantity.units.items():
        for text in (f"3{unit}", f" 3 {unit} ", f"3e0 {unit.replace('/', ' / ')}"):
            assert quantity.option(text) == pytest.approx(3 * size, rel=1e-15)
    with pytest.raises(InputError, match=f"its unit must be one of {', '.join(quantity.units)}$"):
        quantity.read("3 " + ("pounds/m2" if "/" in quantity.unit else "pounds"))
    assert quantity.read_with_unit(quantity.example) > 0


def test_blanks_within_a_unit_make_no_unit_of_it() -> None:
    for text in ("5 m m", "5 k Pa"):
        with pytest.raises(InputError, match="it must be a"):
            (LENGTH if "m m" in text else STRESS).read(text)
    with pytest.raises(InputError, match=r"'m m' is no unit of length: it must be one of m, cm"):
        LENGTH.unit_named("m m")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--h-rms", "10"), "--h-rms is 10, which would be 10 m: give its unit, as in 10um (10m,"),
        (("--period", "2000"), "--period is 2000, which would be 2000 m: give its unit"),
        (("--h-rms", "0.5 furlong"), "--h-rms is '0.5 furlong': its unit must be one of m, cm"),
        (("--period", "0mm"), "--period is 0.0: it must be a positive number"),
        (("--h-rms", "100mm"), "rms slope is "),
        (("--layer", "5"), "--layer is 5, which would be 5 m: give its unit"),
    ],
)
def test_loop_asks_about_a_length_before_it_computes(
    words: tuple[str, ...], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["loop", "--hurst", "0.8", *words]) == 2
    assert capsys.readouterr().err.startswith(f"adhesis loop: {sentence}")


# ---------------------------------------------------------------------- campaign files


def test_lengths_of_a_campaign_may_have_units() -> None:
    assert parse_campaign(campaign_text(period='"1 mm"', h_rms='"1 µm"')) == parse_campaign(
        campaign_text(period="1e-3", h_rms="1e-6")
    )
    several = parse_campaign(campaign_text(h_rms='["1 µm", 2e-6]'))
    assert several.lists == (("profile", "h_rms", (1e-6, 2e-6)),)


def test_a_stiffness_of_a_campaign_may_have_a_unit() -> None:
    text = campaign_text()
    assert parse_campaign(
        text.replace("[cycle]\n", '[cycle]\nstiffness = "2 GPa/m"\n')
    ) == parse_campaign(text.replace("[cycle]\n", "[cycle]\nstiffness = 2e9\n"))
    with pytest.raises(InputError, match=r"its unit must be one of Pa/m, kPa/m, MPa/m, GPa/m$"):
        parse_campaign(text.replace("[cycle]\n", '[cycle]\nstiffness = "1 GPa/mm"\n'))


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        (
            "period",
            "1000",
            "is 1000, which would be 1000 m: give its unit, as in 1000um (1000m, if",
        ),
        ("period", "[1e-3, 2.5]", "is 2.5, which would be 2.5 m"),
        ("h_rms", "1", "is 1, which would be 1 m: give its unit"),
        ("work_of_adhesion", "[0.04, 40]", "is 40, which would be 40 J/m²: give its unit, as in"),
    ],
)
def test_a_campaign_file_is_asked_for_units_as_the_options_are(
    key: str, value: str, words: str, tmp_path: Path
) -> None:
    """The text in a results file is not: what is computed stays readable."""
    more = {"period": "1e4"} if key == "h_rms" else {}
    text = campaign_text(**{key: value} | more)
    (tmp_path / "c.toml").write_text(text)
    with pytest.raises(InputError, match=re.escape(f"] {key} {words}") if not more else "which"):
        load_campaign(tmp_path / "c.toml")
    assert parse_campaign(text).tasks()
    (tmp_path / "c.toml").write_text(
        campaign_text(period='"1000 m"', work_of_adhesion='["40J/m2"]')
    )
    assert load_campaign(tmp_path / "c.toml").sweep.work_of_adhesion == (40.0,)


# ---------------------------------------------------------------------- works of adhesion


def test_a_work_of_adhesion_has_a_unit_or_is_in_joules() -> None:
    texts = ("0.02", "20mJ/m2", "20 mJ/m²", "20mN/m", "20 mN / m", "40J/m^2", "40 N/m")
    read = [WORK_OF_ADHESION.option(text) for text in texts]
    assert read == [0.02, 0.02, 0.02, 0.02, 0.02, 40.0, 40.0]
    for text, sentence in (
        ("20", "is 20, which would be 20 J/m²: give its unit, as in 20mJ/m2 (20J/m2, if J/m² are"),
        (
            "20mJ",
            "is '20mJ': it must be a number in J/m² with a decimal point, as in 0.02, or with",
        ),
        ("0,02", "is '0,02': it must be a number in J/m² with a decimal point"),
        ("20kJ/m2", "its unit must be one of J/m², mJ/m², N/m, mN/m"),
        ("20J/m", "its unit must be one of J/m², mJ/m², N/m, mN/m"),
        ("20mN/m²", "its unit must be one of J/m², mJ/m², N/m, mN/m"),
        ("20Nm", "it must be a number in J/m²"),
    ):
        with pytest.raises(argparse.ArgumentTypeError) as refusal:
            WORK_OF_ADHESION.option(text)
        assert sentence in str(refusal.value)


def test_trace_asks_for_the_unit_of_a_work_of_adhesion(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["trace", "t.csv", "--young", "1e6", "--poisson", "0.5", "--plan"]
    assert main([*words, "--work-of-adhesion", "0.04,40"]) == 2
    assert "--work-of-adhesion is 40, which would be 40 J/m²" in capsys.readouterr().err
    assert main([*words, "--work-of-adhesion", "20mJ"]) == 2
    assert "--work-of-adhesion is '20mJ': it must be a number in J/m²" in capsys.readouterr().err


# ---------------------------------------------------------------------- stresses


@pytest.mark.parametrize(
    ("text", "pascals"),
    [("2e4", 2e4), ("20kPa", 2e4), ("0.3 MPa", 3e5), ("7GPa", 7e9), ("1.5 Pa", 1.5), ("inf", inf)],
)
def test_a_stress_is_the_number_nearest_to_its_decimals(text: str, pascals: float) -> None:
    assert STRESS.option(text) == pascals


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "is '': it must be a stress, as in 2e4 (Pa) or 20kPa"),
        ("1mPa", "is '1mPa': its unit must be one of Pa, kPa, MPa, GPa"),  # a thousandth of 1 Pa
        ("1 bar", "is '1 bar': its unit must be one of Pa"),
    ],
)
def test_what_is_no_stress_is_refused_with_the_rule(text: str, sentence: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError) as refusal:
        STRESS.option(text)
    assert sentence in str(refusal.value)


def test_turning_points_under_a_load_and_keys_of_a_campaign_take_stresses_with_units() -> None:
    parser = parser_of("loop")
    args = parser.parse(["--stiffness", "0", "--max-stress", "0.2kPa,500, 1e-3MPa"])
    assert turns_of(args, Control(0.0)).points == (200.0, 500.0, 1000.0)
    args = parser.parse(["--stiffness", "0", "--max-stress", "0.2kPa,5bar"])
    with pytest.raises(InputError, match="--max-stress is '5bar': its unit must be one of Pa, kPa"):
        turns_of(args, Control(0.0))
    assert parse_campaign(campaign_text(young='"1 MPa"')) == parse_campaign(
        campaign_text(young="1e6")
    )


def test_lengths_are_shown_in_a_unit_of_their_size() -> None:
    assert LENGTH.text(5e-6) == "5 µm"
    assert LENGTH.text(2e-3) == "2 mm"
    assert LENGTH.read_with_unit("2 mm") == 2e-3


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
