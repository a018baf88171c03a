"""Campaign files: what is read, what is refused and how, and how two compare."""

import dataclasses
import math
import os
import re
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from adhesis.ensemble.campaign.file import load_campaign, parse_campaign
from adhesis.ensemble.campaign.tables import TABLES, growth
from adhesis.ensemble.campaign.tasks import Part
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.task.compute import make_problem
from adhesis.ensemble.task.fields import FieldPlan
from adhesis.solver.model.pattern import stripes
from tests.support.campaign_support import ROOT, campaign_text, differing
from tests.support.wrong_values import outside

# The same examples every time. `make fuzz` draws anew, from a seed that it prints.
settings.register_profile("same", derandomize=True, deadline=None)
settings.register_profile("anew", deadline=None, database=None, print_blob=True)
settings.load_profile(os.environ.get("ADHESIS_PROPERTIES", "same"))


def complaint(text: str) -> str:
    try:
        parse_campaign(text, "c.toml")
    except InputError as error:
        return str(error)
    return ""


def refused(text: str) -> str:
    sentence = complaint(text)
    assert sentence
    assert "\n" not in sentence
    return sentence


def test_values_units_and_defaults():
    campaign = parse_campaign(campaign_text(young="1000000"))
    assert campaign.material.young == 1e6
    assert isinstance(campaign.material.young, float)
    assert campaign.sweep.hurst == (0.7, 0.8)
    assert campaign.solver.accuracy == 1e-3
    assert campaign.solver.time_limit is None
    assert campaign.profile.normalisation == {"h_rms": 1e-6}
    assert campaign.task_count == 8
    np.testing.assert_array_equal(campaign.penetration["loading"], 0.6 * np.arange(5) / 4)
    axis = campaign.penetration["unloading"]
    assert axis[0] == 0.6
    assert axis[-1] == pytest.approx(-3)
    np.testing.assert_allclose(np.diff(axis), -0.15)


@pytest.mark.parametrize("path", sorted((ROOT / "jobs").glob("*.toml")), ids=lambda p: p.name)
def test_the_campaigns_that_come_along_are_sound(path):
    campaign = load_campaign(path)
    make_problem(campaign, campaign.tasks()[0])


RULES = {
    (name, entry.name): entry
    for name, table in TABLES.items()
    for entry in dataclasses.fields(table)
}
NOT_NUMBERS = ("true", '"wide"', "{}", "1979-05-27", "[[1]]")


def wrong_values(entry: dataclasses.Field) -> Iterator[str]:
    """Values of a key that break its rule, as a file has them: by kind, bounds, unit and list."""
    rule, is_list = entry.metadata["rule"], "tuple" in str(entry.type)
    wrong = [*NOT_NUMBERS, '"1 furlong"', '"1"']
    if rule.bounds is not None:
        wrong += [repr(number).lower() for number in outside(rule.bounds)]
        if rule.bounds.whole:
            wrong += ["1.0", "9" * 400]
    yield from (f"[{value}]" for value in wrong) if is_list else wrong
    if is_list:
        yield from ("0.5", "[0.5, 0.5]", "[0.0, -0.0]")
    elif not entry.metadata["axis"]:
        yield "[1, 2]"
    else:
        yield from ("[]", f"[{wrong[0]}]")


@pytest.mark.parametrize("key", RULES, ids=".".join)
def test_what_breaks_the_rule_of_a_key_is_named_with_it(key):
    (table, name), entry = key, RULES[key]
    text = re.sub(rf"(?m)^{name} = .*\n", "", campaign_text())
    text = text if f"[{table}]" in text else f"{text}\n[{table}]\n"
    for value in wrong_values(entry):
        sentence = refused(text.replace(f"[{table}]\n", f"[{table}]\n{name} = {value}\n"))
        assert sentence.startswith(f"c.toml: [{table}] {name} is "), (value, sentence)
        rule = r"it must be |which would be |its unit must be one of "
        assert re.search(rf": ({rule})", sentence), (value, sentence)
        assert len(sentence) < 400


# Keys that take the place of the campaign's, or are left out where no value follows; what is said.
REFUSED = r"""
# heights and period in different units: set up, such a profile would fill the memory
h_rms = "1 m" -> [profile] h_rms is 1.0 with period 0.001, so the rms slope is
h_rms = 1e-18 -> [profile] h_rms is 1e-18 with period 0.001, so the rms slope is
h_rms = [1e-6, "1 m"] -> [profile] h_rms is 1.0 with period 0.001, so the rms slope is
ratio = 50000; h_rms = 1e-9; nodes_per_wave = 100000 ->
    [solver] nodes_per_wave is 100000: with 50000 waves it must be at most 1342
# numbers that can hardly be meant without a unit
period = 1000 -> period is 1000, which would be 1000 m: give its unit, as in "1000um" ("1000m", if
period = [1e-3, 2.5] -> period is 2.5, which would be 2.5 m
work_of_adhesion = [0.04, 40] -> work_of_adhesion is 40, which would be 40 J/m²: give its unit, as
# keys that are missing or do not go together
period = -> [profile] period is missing
h_rms = -> none of h_rms, m2 and c0
m2 = 0.1 -> h_rms and m2
max_penetration = -> max_penetration is missing (Δ~max
max_penetration =; control = "load" -> max_stress is missing (mean stress in Pa
max_stress = 5 ->
    max_stress is given: with control = "separation" a path turns at max_penetration, so
control = "load"; max_stress = 5 -> max_penetration is given: with
max_penetration =; control = "load"; max_stress = 5; stiffness = 1e9 ->
    stiffness is given: with control = "load" a path turns at max_stress, so leave
max_penetration =; max_stress = 200 -> which turns at that mean stress, give preload = 200.0
max_penetration =; preload = 200; control = "load" -> a weight or a machine? For a weight give max
preload = 200; max_penetration = [0.5, 0.9] -> several values beside a preload
preload = 200; max_penetration =; stiffness = 1e9 -> max_penetration is missing
preload = [200, 200.0] -> a list of different values
hurst = [0.7, 0.7000000000000001] -> a list of different values
young = [1000000, 1000000.1] -> a list of different values
work_of_adhesion = [0,4] -> work_of_adhesion holds 0,4: write 0.4, or 0.0, 4.0 for two
work_of_adhesion_open = 0.02 -> _open is 0.02: it must be at least the work of adhesion, 0.04
work_of_adhesion_open = 0.08; work_of_adhesion = [0, 0.04] ->
    must be left out, as γ is 0, in every cell
work_of_adhesion_open = 0.08; strength = 3e9 -> _open and a range or strength: at most one
work_of_adhesion_open = 0.08; method = "grid" ->
    [solver] method is 'grid' beside a work_of_adhesion_open
strength = 3e6 -> [solver] method is 'grid' beside a range or strength
stripes = 2 -> [material] stripe_amplitude is missing: give the number of stripes
stripe_phase = 1.0 -> [material] stripes is missing: give the number of stripes
stripes = 2; stripe_amplitude = 0.1; strength = 1e8; method =; nodes_per_wave = ->
    is given beside a strength
# rules that hold in every cell
n0 = [1, 2]; ratio = [3, 60000] -> n0 · ratio is 120000
ratio = [4, 16]; rolloff = [2, 8] -> rolloff is 8
max_penetration = [0.6, 0.3]; field_penetrations = [0.1] ->
    field_penetrations is given beside several max_penetration
max_penetration =; control = "load"; max_stress = 300; field_penetrations = [0.1] ->
    field_penetrations is given under a load
field_penetrations = [0.7] -> field_penetrations
field_penetrations = [-3.5] -> field_penetrations
realisations = 2000000000 -> tasks: it must make at most
load_steps = 100000; unloading_until = -1000 -> unloading curve has
# keys that vary together
h_rms = [1e-6, 2e-6]; zip = [["hurst", "young"]] ->
    zip names 'young': it must name keys that are lists
h_rms = [1e-6, 2e-6]; zip = [["hurst", "h_rms"], ["hurst", "work_of_adhesion"]] -> zip is
h_rms = [1e-6, 2e-6, 3e-6]; zip = [["hurst", "h_rms"]] ->
    zip joins lists of different lengths (h_rms 3, hurst 2)
# a wanted precision
batch = 8 -> [stop] relative_error is missing
relative_error = 0.1; most = 1 -> [stop] most is 1: it must be at least realisations
"""
CASES = [
    line.split("-> ") for line in re.sub(r"->\n +", "-> ", REFUSED).splitlines() if "->" in line
]


@pytest.mark.parametrize(("changes", "sentence"), CASES, ids=[changes for changes, _ in CASES])
def test_keys_that_are_impossible_together_are_refused_by_name(changes, sentence, tmp_path):
    text = campaign_text()
    for change in changes.split(";"):
        key, _, value = (word.strip() for word in change.partition("="))
        (table,) = {name for name, entry in RULES if entry == key}
        text = re.sub(rf"(?m)^{key} = .*\n", "", text)
        if key == "work_of_adhesion_open":  # which the grid refuses
            text = text.replace('method = "grid"\nnodes_per_wave = 16\n', "")
        text = text if f"[{table}]" in text else f"{text}\n[{table}]\n"
        if value:
            text = text.replace(f"[{table}]\n", f"[{table}]\n{key} = {value}\n")
    path = tmp_path / "c.toml"
    path.write_text(text)
    with pytest.raises(InputError) as refusal:
        load_campaign(path)
    assert sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_keys_that_vary_together_are_not_refused_for_what_they_never_are_together():
    """The smallest period and the largest height: neither value of the one meets the other's."""
    lists = {"period": "[1e-9, 1e-3]", "h_rms": "[1e-12, 1e-6]"}
    zipped = campaign_text(**lists).replace("[sweep]", '[sweep]\nzip = [["period", "h_rms"]]')
    assert parse_campaign(zipped).task_count
    sentence = refused(campaign_text(**lists))
    assert "h_rms is 1e-06 with period 1e-09, so the rms slope is" in sentence


def test_a_number_of_any_length_is_refused_in_one_short_sentence():
    assert len(refused(campaign_text(realisations="9" * 400))) < 300
    assert len(refused(campaign_text(young="1" + "0" * 400))) < 300
    refused(campaign_text(seed="9" * 5000))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (campaign_text().replace("period =", "periode ="), "periode is unknown"),
        (campaign_text() + "\n[extra]\nx = 1\n", "'extra' is unknown"),
        (campaign_text().replace("n0", '"a\\nb"'), "unknown"),
        ("profile = 3\n", "profile is 3: it must be a table"),
        ("[profile\n", "is not valid TOML"),
        (
            campaign_text().replace("n0 =", "n0 = 3\nn0 ="),
            "in 'n0 = 1', whose key is given before, so remove one of the two",
        ),
        ("[sweep]\nhurst = [0,7", "in 'hurst = [0,7', where values are as 0.5, [0.5, 0.6], or"),
        ("[sweep]\nzip = []\nzip = [\n]", "in 'zip = [', whose key is given before, so remove"),
        ("[cycle]\r\nload_steps = 20\r\n\f\r\n", "is not valid TOML: Invalid statement"),
        *(
            (
                campaign_text().replace("poisson = 0.5", f"poisson = {text}"),
                f"in 'poisson = {text}'",
            )
            for text in ("0,5", ".5", "1/2", "0.5 // rubber")
        ),
        *(
            (campaign_text(young="1e6").replace(old, new, 1), f"{place}, where TOML has {plain}")
            for old, new, place, plain in (
                ("1e6", "“1 MPa”", "line 8, column 9 holds “ (U+201C)", '"'),
                ("1e6", "−1e6", "line 8, column 9 holds − (U+2212)", "-"),
                ("= ", "=\u3000", "line 2, column 9 holds a blank (U+3000)", "a plain blank"),
            )
        ),
        ("x = " + "[" * 5000, "is not valid TOML"),
        ("# " + "x" * 70_000, "bytes"),
        ("", "[profile] period is missing"),
    ],
)
def test_bad_files_are_refused_in_one_sentence(text, words):
    assert words in refused(text)


def test_growth_and_other_changes_are_told_apart():
    old = parse_campaign(campaign_text())
    more = {"hurst": "[0.9, 0.7, 0.8]", "work_of_adhesion": "[0.01, 0.04, 0.07]"}
    grown = parse_campaign(campaign_text(**more, realisations="3"))
    keys = {"sweep.hurst", "sweep.work_of_adhesion", "sweep.realisations"}
    assert set(growth("f", old, grown)) == keys
    # The other way round nothing grew: there is no file without the rows it holds.
    assert len(differing(grown, old)) == 3
    assert differing(old, parse_campaign(campaign_text(load_steps="5", seed="6"))) == [
        "sweep.seed is 6 here and 5 there",
        "cycle.load_steps is 5 here and 4 there",
    ]


def test_the_same_profile_across_work_of_adhesion_and_phases_across_hurst():
    more = parse_campaign(campaign_text(realisations="9")).tasks()
    seeds = {t.realisation: t.seed for t in more}
    assert len(set(seeds.values())) == 9
    assert all(0 <= seed < 2**53 for seed in seeds.values())
    # A campaign that grows keeps the seeds it had.
    tasks = parse_campaign(campaign_text(realisations="3")).tasks()
    assert all(t.seed == seeds[t.realisation] for t in [*tasks, *more])


def test_seeds_are_a_promise():
    """Written down: a release that changes them would break every campaign that is to grow."""
    tasks = parse_campaign(campaign_text(seed="0")).tasks()
    assert [t.seed for t in list(tasks)[:2]] == [4232842298785526, 2383740928328724]


PLAIN = st.one_of(
    st.booleans(),
    st.integers(),
    st.floats(),
    st.sampled_from(['""', '"x"', "[]", "[[1]]", "{}", "1979-05-27", "0.5", "3", "[0.5]"]),
)
KEYS = [line.split(" = ")[0] for line in campaign_text().splitlines() if " = " in line]


@settings(max_examples=100)
@example({"max_penetration": 3.45e-283})  # once a sentence of 300 digits
@given(st.dictionaries(st.sampled_from(KEYS), PLAIN, min_size=1, max_size=3))
def test_any_value_is_read_or_refused_in_one_sentence(changes):
    def spelt(value: object) -> str:
        return str(value).lower() if isinstance(value, bool | float) else str(value)

    text = campaign_text(**{key: spelt(value) for key, value in changes.items()})
    sentence = complaint(text)
    assert "\n" not in sentence
    assert len(sentence) < 400
    if not sentence:
        assert parse_campaign(text) == parse_campaign(text)


@settings(max_examples=100)
@given(st.data())
def test_any_damage_to_the_text_is_read_or_refused_in_one_sentence(data):
    text = campaign_text()
    start = data.draw(st.integers(0, len(text)))
    stop = data.draw(st.integers(start, min(len(text), start + 20)))
    text = text[:start] + data.draw(st.text(max_size=8)) + text[stop:]
    assert "\n" not in complaint(text)


AXES = {"ratio": "[4, 2]", "young": "[1e6, 2e6]", "max_penetration": "[0.6, 0.3]"}


def test_every_list_is_an_axis():
    campaign = parse_campaign(campaign_text(**AXES))
    assert [axis.key for axis in campaign.axes] == [
        *("sweep.hurst", "sweep.work_of_adhesion"),
        *("profile.ratio", "material.young", "cycle.max_penetration"),
    ]
    tasks = campaign.tasks()
    assert len(tasks) == campaign.task_count == 2 * 2 * 2 * 2 * 2 * 2
    assert len(set(tasks)) == len(tasks)
    first, last = tasks[0], tasks[-1]
    assert first.others == (("ratio", 2), ("young", 1e6), ("max_penetration", 0.3))
    assert "ratio = 4, young = 2 MPa, max_penetration = 0.6, realisation 1" in str(last)
    here = campaign.at(last)
    assert (here.profile.ratio, here.material.young, here.cycle.max_penetration) == (4, 2e6, 0.6)
    assert not here.has_axis("ratio")
    assert len({t.seed for t in tasks}) == 2  # the same phases along every axis
    one = parse_campaign(campaign_text(ratio="[4]"))
    assert one == parse_campaign(campaign_text(ratio="4"))


def test_cells_of_a_part_ascend_though_their_first_realisations_differ():
    campaign = parse_campaign(campaign_text(hurst="[0.7]", ratio="[4, 8]", realisations="3"))
    tasks = campaign.tasks(Part(2, 2))
    firsts = [(task.work_of_adhesion, task.others) for task, _ in tasks.by_cell()]
    assert firsts == sorted(firsts)
    assert [task.realisation for task, _ in tasks.by_cell()][:2] == [1, 0]


def test_lists_vary_together_where_that_is_asked_for():
    lists = {"hurst": "[0.8, 0.7]", "h_rms": "[2e-6, 1e-6]"}
    campaign = parse_campaign(campaign_text(**lists, seed='5\nzip = [["h_rms", "hurst"]]'))
    cells = {(h, dict(o)["h_rms"]) for h, o in ((t.hurst, t.others) for t in campaign.tasks())}
    assert cells == {(0.8, 2e-6), (0.7, 1e-6)}
    assert campaign.task_count == 2 * 2 * 2


def test_a_number_may_become_an_axis_and_an_axis_longer():
    old = parse_campaign(campaign_text())
    grown = parse_campaign(campaign_text(young="[1e6, 2e6]"))
    assert growth("f", old, grown) == ("material.young",)
    assert differing(old, parse_campaign(campaign_text(young="[2e6, 3e6]")))
    assert differing(old, parse_campaign(campaign_text(max_penetration="[0.6, 0.3]")))
    fewer, some = (
        parse_campaign(under(f"preload = {p}")) for p in ("[100, 400]", "[100, 300, 400]")
    )
    assert differing(fewer, some)[0].startswith("cycle.preload is")  # stops of one branch
    # Pairs that were computed must be pairs still.
    paired = {"seed": '5\nzip = [["hurst", "h_rms"]]'}
    one = parse_campaign(campaign_text(h_rms="[1e-6, 2e-6]", **paired))
    more = {"hurst": "[0.7, 0.8, 0.9]"}
    two = parse_campaign(campaign_text(h_rms="[1e-6, 2e-6, 3e-6]", **more, **paired))
    three = parse_campaign(campaign_text(h_rms="[1e-6, 3e-6, 2e-6]", **more, **paired))
    assert set(growth("f", one, two)) == {"profile.h_rms", "sweep.hurst"}
    assert differing(one, three)


def under(cycle):
    return campaign_text().replace("max_penetration = 0.6", cycle)


def test_a_path_turns_where_its_control_lets_it_turn():
    load = parse_campaign(under('control = "load"\nmax_stress = [300, 100]'))
    assert load.cycle.under_load
    assert load.cycle.turning_point == 100
    first = load.tasks()[0]
    assert [load.at(task).cycle.turning_point for task in load.sharing(first)] == [100, 300]
    assert load.penetration["unloading"][0] == 1.0
    assert load.curve_axes(first)["loading"][-1] == 1.0


def test_fields_under_a_load_are_kept_at_parts_of_it():
    text = under('control = "load"\nmax_stress = 300')
    plan = FieldPlan(parse_campaign(text))
    np.testing.assert_allclose(plan.penetration, [0.25, 0.75, 1.0])  # of 4 load steps
    assert plan.campaign.cycle.turning_point == 300


# Keys of [material] that make an interface, γ = 0.04 J/m²; what the problems of the tasks have.
INTERFACES: list[tuple[str, str, list[object]]] = [
    ('measure = "flat"', "measure", ["flat"]),
    ("adhesion_range = [1e-8, 2e-8]", "strength", [4e6, 2e6]),
    ("strength = 3e6", "strength", [3e6]),
    ('work_of_adhesion_open = ["50 mJ/m2", 0.08]', "work_of_adhesion_open", [0.05, 0.08]),
    ("work_of_adhesion_open = 0.04", "work_of_adhesion_open", [None]),  # also with the method grid
    ("stripes = 2\nstripe_amplitude = 0.1", "pattern", [stripes(2, 0.1)]),
    (
        "stripes = [2, 8]\nstripe_amplitude = [0.1, 0.3]\nstripe_phase = 0.5",
        "pattern",
        [stripes(n, e, 0.5) for n in (2, 8) for e in (0.1, 0.3)],
    ),
]


@pytest.mark.parametrize(("keys", "name", "found"), INTERFACES)
def test_keys_of_the_interface_reach_every_task_and_may_be_axes(keys, name, found):
    text = campaign_text(work_of_adhesion="[0.04]", hurst="[0.8]", realisations="1")
    if keys != "work_of_adhesion_open = 0.04":  # the others are not for the grid
        text = text.replace('method = "grid"\nnodes_per_wave = 16\n', "")
    campaign = parse_campaign(text.replace("poisson = 0.5", f"poisson = 0.5\n{keys}"))
    assert [getattr(make_problem(campaign, task), name) for task in campaign.tasks()] == found
    assert campaign.material.opens == (name == "strength")
    plain = make_problem(campaign := parse_campaign(text), campaign.tasks()[0])
    assert (plain.measure, plain.strength) == ("arc", math.inf)
    assert plain.work_of_adhesion_open is plain.pattern is None
    assert not campaign.material.opens
