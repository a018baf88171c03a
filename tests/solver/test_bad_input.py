"""Bad input of every public function and class: one sentence with name, value and rule."""

import copy
import pickle
import re
from collections.abc import Callable
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from functools import cache, partial
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import adhesis
from adhesis import (
    Control,
    HalfSpace,
    InputError,
    LoopResult,
    PathResult,
    Problem,
    Profile,
    loss_of_trace,
    make_method,
    prepare_trace,
    profile_from_heights,
    run_loop,
    run_loops,
    run_path,
    self_affine_profile,
    single_wave,
)
from adhesis.ensemble.errors import naming_options
from adhesis.ensemble.quantities import UNITS
from adhesis.ensemble.trace.reading.measured_trace import Trace
from adhesis.solver import checks
from adhesis.solver.checks import Bounds, counted, real, shown, whole
from adhesis.solver.loading.cycle import check_cycle
from adhesis.solver.method import MethodReport
from tests.support.exact_wave import ExactWave
from tests.support.scenes import rough
from tests.support.wrong_values import WithUnit, outside

PERIOD, AMPLITUDE = 1e-3, 1e-6
WAVE = single_wave(AMPLITUDE, PERIOD)
SOLID = HalfSpace(1e6, 0.5)
PROBLEM = Problem(WAVE, SOLID, 0.04)
METHOD = ExactWave(PROBLEM)
UNDER_LOAD = ExactWave(Problem(WAVE, SOLID, 0.04, Control(0.0)))
SPECTRUM: dict[str, Any] = {
    "hurst": 0.8,
    "period": 2e-3,
    "n0": 2,
    "ratio": 4,
    "seed": 1,
    "h_rms": 1e-6,
}
RELOADED = type("Problem", (), {"__module__": Problem.__module__})
LEFT_OUT = pd.Series(range(9), index=range(9), dtype=float).drop(4)
TRACE = Trace(self_affine_profile(**SPECTRUM).heights(400), 5e-6, "t.csv")


def spectral(**change: Any) -> Profile:
    return self_affine_profile(**{**SPECTRUM, **change})


def loop(**change: Any) -> LoopResult:
    return run_loop(
        change.pop("method", METHOD), **{"max_penetration": 0.5, "load_steps": 4} | change
    )


def loops(turns: Any, **change: Any) -> tuple[LoopResult, ...]:
    return run_loops(
        change.pop("method", METHOD), max_penetration=turns, **{"load_steps": 4} | change
    )


def path(points: Any, **change: Any) -> PathResult:
    return run_path(change.pop("method", METHOD), points, **{"load_steps": 4} | change)


def answer(**change: Any) -> Any:
    prepared = change.pop("prepared", None) or prepare_trace(TRACE)
    return loss_of_trace(prepared, **{"half_space": SOLID, "work_of_adhesion": 0.04} | change)


NOT_NUMBERS: list[Any] = [
    np.array(1.0).view(WithUnit),
    *(True, np.bool_(False), "1", b"1", None, 1j, {}, object(), np.ma.masked),
    *([1.0], (1.0,), np.array([1.0]), np.array([])),
]
# Each parameter that is one number, and its rule.
NUMBERS: dict[str, tuple[Callable[[Any], Any], Bounds]] = {
    "young": (lambda v: HalfSpace(v, 0.5), checks.YOUNG),
    "poisson": (lambda v: HalfSpace(1e6, v), checks.POISSON),
    "thickness": (lambda v: HalfSpace(1e6, 0.3).layer_stiffness(v), checks.LENGTH),
    "stiffness": (lambda v: Control(v), checks.STIFFNESS),
    "work_of_adhesion": (lambda v: Problem(WAVE, SOLID, v), checks.WORK_OF_ADHESION),
    "amplitude": (lambda v: single_wave(v, 1e-3), checks.FINITE),
    "period": (lambda v: single_wave(1e-6, v), checks.LENGTH),
    "hurst": (lambda v: spectral(hurst=v), checks.HURST),
    "n0": (lambda v: spectral(n0=v), checks.HARMONIC),
    "ratio": (lambda v: spectral(ratio=v), checks.HARMONIC),
    "seed": (lambda v: spectral(seed=v), checks.SEED),
    "rolloff": (lambda v: spectral(rolloff=v), checks.ROLLOFF),
    "h_rms": (lambda v: spectral(h_rms=v), checks.HEIGHT),
    "m2": (lambda v: spectral(h_rms=None, m2=v), checks.MEAN_SQUARE_SLOPE),
    "accuracy": (lambda v: make_method("grid", PROBLEM, accuracy=v), checks.ACCURACY),
    "nodes_per_wave": (
        lambda v: make_method("grid", PROBLEM, nodes_per_wave=v),
        checks.NODES_PER_WAVE,
    ),
    "load_steps": (lambda v: loop(load_steps=v), checks.LOAD_STEPS),
    "max_penetration": (lambda v: loop(max_penetration=v), checks.MAX_PENETRATION),
    "preload": (lambda v: loop(max_penetration=None, preload=v), checks.MAX_STRESS),
    "strength": (lambda v: Problem(WAVE, SOLID, 0.04, strength=v), checks.STRENGTH),
    "adhesion_range": (
        lambda v: Problem(WAVE, SOLID, 0.04, adhesion_range=v),
        checks.ADHESION_RANGE,
    ),
    "work_of_adhesion_open": (
        lambda v: Problem(WAVE, SOLID, 0.0, work_of_adhesion_open=v),
        checks.WORK_OF_ADHESION,
    ),
    "max_stress": (
        lambda v: loop(method=UNDER_LOAD, max_penetration=None, max_stress=v),
        checks.MAX_STRESS,
    ),
    "n": (lambda v: WAVE.heights(v), checks.NODES),
    "derivative": (lambda v: WAVE.at(0.0, v), Bounds(0, 16, whole=True)),
    "order": (lambda v: WAVE.moment(v), Bounds(0, 16, whole=True)),
    "within": (lambda v: WAVE.crests(v), Bounds(0.0)),
    "distance": (lambda v: WAVE.shifted(v), checks.FINITE),
    "height": (lambda v: WAVE.scaled(v), checks.FINITE),
    "length": (lambda v: WAVE.scaled(1.0, v), checks.FINITE),
}
OPTIONAL = {
    *("max_penetration", "max_stress", "preload", "h_rms", "m2", "nodes_per_wave"),
    *("strength", "adhesion_range", "work_of_adhesion_open"),
}


@pytest.mark.parametrize("name", NUMBERS)
def test_what_is_no_number_or_breaks_its_bounds_is_refused(name: str) -> None:
    call, bounds = NUMBERS[name]
    huge = [] if bounds.whole and bounds.high == np.inf else [10**400]
    for value in [*NOT_NUMBERS, *outside(bounds), *huge]:
        if value is None and name in OPTIONAL:
            continue
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        with pytest.raises(ValueError if is_number else TypeError) as caught:
            call(value)
        sentence = str(caught.value)
        assert sentence.startswith(f"{name} is ")
        assert sentence.endswith(f": it must be {bounds.text}")
        assert len(sentence) < 300
        assert "\n" not in sentence
        assert shown(value) in sentence or not is_number


@pytest.mark.parametrize(
    "two",
    [2, 2.0, np.float32(2), np.float64(2), np.int64(2), np.array(2.0), Fraction(2), Decimal(2)],
)
def test_whatever_is_a_number_is_taken_as_one(two: Any) -> None:
    assert real("x", two) == 2.0
    assert type(real("x", two)) is float
    assert whole("x", two, Bounds(0, 9, whole=True)) == 2
    assert HalfSpace(two, 0.5) == HalfSpace(2.0, 0.5)
    assert spectral(n0=two) == spectral(n0=2)
    assert check_cycle(0.5, two, Control()) == (0.5, 2)


def labelled(units: object) -> pd.Series:
    """Return a column of a table whose attributes state units."""
    column = pd.Series([1e-6, 0.0, 2e-6, 0.0], name="z")
    column.attrs["units"] = units
    return column


@pytest.mark.parametrize(
    "units", [*sorted({*UNITS.values(), ""}), "-", "J/m^2", "m**-2", {"z": "m"}, {"x": "um"}]
)
def test_a_column_in_si_units_is_a_row_of_numbers(units: object) -> None:
    column = labelled(units)
    assert profile_from_heights(column, PERIOD) == profile_from_heights(column.array, PERIOD)
    assert np.array_equal(checks.row("heights", xr.DataArray(column)), column)


MASKED = np.ma.array([1.0, 2.0, 4.0], mask=[False, True, False])
ROWS: list[tuple[Any, type[Exception], str]] = [
    (MASKED, ValueError, "[1] is masked (1 in all): every"),
    ([0.0, np.ma.masked, 1.0], TypeError, "[1] is masked: it must be a real number"),
    ([True, False, True], TypeError, "[0] is True: it must be a real number"),
    ([0.0, True, 2.0], TypeError, "[1] is True: it must be a real number"),
    (np.array([True, False, True]), TypeError, " holds booleans: every"),
    (np.array(["1", "2", "3"]), TypeError, " holds texts: every"),
    (np.array([0.0, 0.5]).view(WithUnit), TypeError, " carries a unit, which would be lost"),
    *(
        (labelled(u), TypeError, " carries a unit, which would be lost")
        for u in ("um", "mm", "MPa", "V", "10 m", "m/µm", {"z": "um"})
    ),
    (xr.DataArray([0.0, 0.5], attrs={"units": "um"}), TypeError, " carries a unit, which would"),
    (["0", "1", "2"], TypeError, "[0] is '0': it must be a real number"),
    ([0.0, None, 2.0], TypeError, "[1] is None: it must be a real number"),
    (np.array([0.0, None, 2.0]), TypeError, "[1] is None: it must be a real number"),
    (np.array([0, 1, 2], dtype="m8[s]"), TypeError, " holds timedelta64[s]: every"),
    ("0,1,2", TypeError, " is '0,1,2': it must be a row of numbers"),
    (None, TypeError, " is None: it must be a row of numbers"),
    (3.0, TypeError, " is 3.0: it must be a row of numbers"),
    ({0: 1.0}, TypeError, " is {0: 1.0}: it must be a row of numbers"),
    ([[0.0, 1.0], [2.0]], ValueError, " holds rows of different lengths"),
    (np.ones((3, 3)), ValueError, " has 2 dimensions: it must be one row of numbers"),
]
OF_ROWS: dict[str, Callable[[Any], Any]] = {
    "heights": lambda v: profile_from_heights(v, PERIOD),
    "coefficients": lambda v: Profile(PERIOD, v),
    "max_penetration": loops,
    "turning_points": path,
}


@pytest.mark.parametrize(
    ("name", "row", "error", "text"),
    [
        (name, *case)
        for name in OF_ROWS
        for case in ROWS
        if name != "max_penetration" or case[0] is not None  # None is another control's
    ],
    ids=lambda v: repr(v)[:20],
)
def test_what_is_no_row_of_numbers_is_refused(name, row, error, text):
    with pytest.raises(error) as caught:
        OF_ROWS[name](row)
    assert str(caught.value).startswith(name + text)


@pytest.mark.parametrize(
    "row",
    [
        [0, 1, 4],
        (0.0, 1.0, 4.0),
        np.array([0, 1, 4], dtype=np.int16),
        np.ma.array([0.0, 1.0, 4.0]),
        pd.Series([0.0, 1.0, 4.0], index=[7, 8, 9]),
        np.array([0, Fraction(1), Decimal(4)], dtype=object),
        [0.0, np.float32(1), np.array(4.0)],
        iter([0.0, 1.0, 4.0]),
    ],
    ids=lambda row: type(row).__name__,
)
def test_whatever_is_a_row_of_numbers_is_taken_as_one(row: Any) -> None:
    assert profile_from_heights(row, 1.0) == profile_from_heights(np.array([0.0, 1.0, 4.0]), 1.0)


STATES = METHOD.follow(METHOD.detached(AMPLITUDE), 0.5 * AMPLITUDE).states


@cache
def one_loop() -> LoopResult:
    return loop()


@cache
def one_path() -> PathResult:
    return path([0.5, 0.3, 0.4])


# What is called, and how that ends; indented where it is long.
REFUSED = r"""
# wrong order, wrong kind
Problem(SOLID, WAVE, 0.04) -> TypeError: profile is a HalfSpace: it must be a Profile; make one
Problem(WAVE, SOLID, 0.04, 'load') -> TypeError: control is 'load': it must be a Control
Problem(WAVE, HalfSpace, 0.04) -> TypeError: half_space is the class HalfSpace: it
checks.instance('problem', RELOADED(), Problem, 'Problem(…)') ->
    TypeError: problem is a Problem made before a reload of adhesis
make_method('auto', WAVE) -> TypeError: problem is a Profile: it must be a Problem; make one with
make_method(PROBLEM, 'auto') -> TypeError: method is a Problem: it must be one of grid, sharp
make_method('magic', PROBLEM) -> ValueError: method is 'magic': it must be one of grid, sharp, zones
make_method('grid', Problem(spectral(ratio=1000), SOLID, 1), nodes_per_wave=10 ** 5) ->
    ValueError: nodes_per_wave is 100000: with 2000 waves it must be at most 33554, 67108864 nodes
make_method('sharp', PROBLEM, nodes_per_wave=32) ->
    ValueError: nodes_per_wave is 32: it belongs to the methods 'grid' and 'zones'
ExactWave(WAVE) -> TypeError: problem is a Profile: it must be a Problem
Method(PROBLEM) -> TypeError: Can't instantiate abstract class Method
loop(method=PROBLEM) ->
    TypeError: method is a Problem: it must be a Method; make one with make_method(name, problem)
loops([0.5], method='grid') -> TypeError: method is 'grid': it must be a Method; make one with
path([0.5], method=None) -> TypeError: method is None: it must be a Method; make one with
loop(progress=3) -> TypeError: progress is 3: it must be a function, or None
loop(on_state='print') -> TypeError: on_state is 'print': it must be a function, or None
loop(max_penetration=None) ->
    ValueError: a path under a separation or a stiffness turns at max_penetration
loops(None) -> ValueError: a path under a separation or a stiffness turns at max_penetration
loops([]) -> ValueError: turning points are []: there must be some, all different
loops([0.5, 0.5]) -> ValueError: turning points are [0.5, 0.5]: there must be some, all
path([]) -> ValueError: a path needs at least one turning point
path([0.5, np.nan, 0.6]) ->
    ValueError: turning_points[1] is nan: every turning point must be a finite number
path([0.3, 0.5]) -> ValueError: the path goes from 0.3 to 0.5: after loading it must unload
path([0.5, 0.3, 0.2]) -> ValueError: after unloading it must load
path([0.5, 0.3]) -> ValueError: omit that turning point
path([1.2]) -> ValueError: turning_points is 1.2
path([-0.3]) -> ValueError: the path starts with -0.3: it must start with loading
path([0.5], out='no') -> TypeError: out is 'no': it must be True or False
loop(preload=20.0, max_stress=20.0) -> ValueError: preload and max_stress are given
loop(method=UNDER_LOAD, max_penetration=None, preload=20.0) -> ValueError: a weight or a machine
loop(preload=20.0, max_penetration=1.0) -> ValueError: max_penetration is 1.0: it must be
# interfaces
Problem(WAVE, SOLID, 0.3, measure='projected') ->
    ValueError: measure is 'projected': it must be one of arc, flat
Problem(WAVE, SOLID, 0.04, adhesion_range=1e-09, strength=1000000.0) ->
    ValueError: adhesion_range is 1e-09 and strength is
make_method('sharp', Problem(WAVE, SOLID, 0.04, strength=1000.0)) ->
    ValueError: adhesion_range is 4e-05 m, strength 1000 Pa: with the method 'sharp' they
Problem(WAVE, SOLID, 0.0, work_of_adhesion_open=0.1) ->
    ValueError: it must be left out, as γ is 0
Problem(WAVE, SOLID, 0.004, work_of_adhesion_open=1.0, strength=1000000.0) ->
    ValueError: beside a strength of 1e+06 Pa: give
make_method('zones', Problem(WAVE, SOLID, 0.004, adhesion_range=1.0)) ->
    ValueError: adhesion_range is 1 m, strength 0.004 Pa: the range must be at most
make_method('auto', Problem(WAVE, SOLID, 0.004, work_of_adhesion_open=1.0), nodes_per_wave=32) ->
    ValueError: nodes_per_wave is 32 beside a work_of_adhesion_open
stripes(3, 1.0) -> ValueError: amplitude is 1.0: it must be
stripes(0, 0.5) -> ValueError: count is 0: it must be
AdhesionPattern([0.1]) -> ValueError: it must be 0
AdhesionPattern([0, np.nan]) -> ValueError: pattern coefficients[1] is (nan+0j): every coefficient
AdhesionPattern([0, 0.4, 0, 0.2]) -> ValueError: the work of adhesion to -0.2 of its mean
Problem(WAVE, SOLID, 0.004, strength=1e7, pattern=stripes(2, 0.1)) ->
    ValueError: is given beside a strength of 1e+07 Pa: give one of them
Problem(WAVE, SOLID, 0.0, pattern=stripes(2, 0.1)) ->
    ValueError: is given beside γ = 0: give one of them
Problem(WAVE, SOLID, 0.004, pattern=0.3) -> TypeError: pattern is 0.3
# profiles
profile_from_heights([2.0, 2.0, 2.0], 1.0) -> ValueError: the profile is flat (h_max = 0)
profile_from_heights([1.0, 2.0], 1.0) -> ValueError: heights hold 2 value(s): at least 3
profile_from_heights(LEFT_OUT, 1.0) -> ValueError: the index of heights leaves rows out, or has
profile_from_heights(xr.DataArray(LEFT_OUT), 1.0) -> ValueError: the index of heights leaves rows
profile_from_heights([0.0, 1e+200, 0.0], 1.0) -> ValueError: largest height is 1e+200: it must be
profile_from_heights([0.0, 1e-200, 0.0], 1.0) -> ValueError: largest coefficient is 3.3
profile_from_heights([1, 2j, 3], 1.0) -> TypeError: heights[1] is 2j: it must be a real number
Profile(1.0, np.zeros(3)) -> ValueError: the profile is flat
Profile(1.0, [0, np.nan]) -> ValueError: coefficients[1] is (nan+0j): every coefficient
Profile(1.0, [1, 1]) -> ValueError: a_0 is (1+0j): a profile has zero mean
Profile(1.0, [0]) -> ValueError: a profile has the coefficients a_0 … a_M, M ≥ 1
WAVE.at('a') -> TypeError: x is 'a': it must be a real number, or an array of them
WAVE.at(MASKED) -> ValueError: x holds masked values
WAVE.heights(2) -> ValueError: 2 nodes are too few
single_wave(0.0, 1.0) -> ValueError: the profile is flat
spectral(h_rms=None) -> ValueError: give exactly one of h_rms, m2 and c0; given: none
spectral(ratio=10 ** 5) -> ValueError: n0 · ratio is 200000: it must be at most 100000
spectral(rolloff=9) -> ValueError: rolloff is 9: it must be at most ratio (4)
spectral(amplitudes='gauss') ->
    ValueError: amplitudes is 'gauss': it must be one of deterministic, rayleigh
SOLID.layer_stiffness(0.001) -> ValueError: poisson is 0.5: a layer that is incompressible
# results
one_loop().states('up') -> ValueError: branch is 'up': it must be one of loading, unloading
one_loop().on_axis('loading', one_loop().energy[:3]) ->
    ValueError: values have the shape (3,): there must be one for each
one_loop().at('loading', 'a', one_loop().energy) ->
    TypeError: drives is 'a': it must be a real number
one_loop().to_dataframe('patches') -> ValueError: of is 'patches': it must be
one_loop().save('loop.h5') -> InputError: the name must end in .nc
one_loop().save(3) -> TypeError: path is 3
one_loop().film('a.avi') -> InputError: path is a.avi: the name must end in .html,
one_loop().film(3) -> TypeError: path is 3
one_loop().film(frames=1) -> ValueError: frames is 1: it must be
one_loop().film(progress=3) -> TypeError: progress is 3
one_loop().film('none/a.html', frames=2) -> InputError: no directory
replace(one_loop(), contact_states=()).film() -> ValueError: this result holds no contact states
one_loop().mean_stress.__setitem__(0, 1.0) -> ValueError: assignment destination is read-only
setattr(one_loop(), 'loss', 0.0) -> AttributeError: cannot assign to field 'loss'
one_path().potential.__setitem__(0, 1.0) -> ValueError: assignment destination is read-only
STATES[-1].edges.__setitem__((0, 0), 1.0) -> ValueError: assignment destination is read-only
METHOD.fields(STATES[-1], 16).gap.__setitem__(0, 1.0) ->
    ValueError: assignment destination is read-only
METHOD.openings(STATES[-1])[0].gap.__setitem__(0, 1.0) ->
    ValueError: assignment destination is read-only
setattr(one_loop().jumps[0], 'energy_drop', 0.0) ->
    AttributeError: cannot assign to field 'energy_drop'
setattr(one_path().minor_loops[0], 'loss', 0.0) -> AttributeError: cannot assign to field 'loss'
setattr(adhesis.Path((), ()), 'states', ()) -> AttributeError: cannot assign to field 'states'
WAVE.coefficients.__setitem__(1, 1.0) -> ValueError: assignment destination is read-only
# campaigns and files
adhesis.Campaign(3) -> TypeError: source is a int: it must be a dict
adhesis.Campaign({'sweeps': {}}) -> InputError: campaign: 'sweeps' is unknown; the tables are
adhesis.load(3) -> TypeError: path is 3: it must be a path
# traces
prepare_trace('file.csv') ->
    TypeError: trace is 'file.csv': it must be a Trace; make one with read_trace(source)
prepare_trace(TRACE, degree='1') -> TypeError: degree is '1': it must be a whole number
prepare_trace(TRACE, cut_off=-1e-06) -> InputError: cut_off is -1e-06: it must be a positive
prepare_trace(TRACE, tip_radius=np.nan) -> InputError: tip_radius is nan: it must be
prepare_trace(TRACE, longest_gap=-1) -> InputError: longest_gap is -1: it must be a number from 0
prepare_trace(TRACE, exclude=[(np.nan, 0.001)]) -> InputError: a range must begin at 0 or later
prepare_trace(TRACE, exclude=[(0.005, 0.006)]) ->
    InputError: in which there is no height: t.csv reaches from 0 to 1.995 mm
prepare_trace(TRACE, exclude=[(0.0, 0.00195)]) ->
    InputError: exclude leaves 9 heights of t.csv: at least 32 must be left
prepare_trace(TRACE, exclude=[(0.0002, 0.0008)]) -> InputError: % of its heights, with what exclude
prepare_trace(TRACE, exclude='1mm:2mm') -> TypeError: it must hold pairs of positions in m, as in
prepare_trace(TRACE, exclude=[(1.0,)]) -> TypeError: it must hold pairs of positions in m, as in
prepare_trace(TRACE, invert='yes') -> TypeError: invert is 'yes': it must be True or False
prepare_trace(TRACE, keep_outliers=1) -> TypeError: keep_outliers is 1: it must be True or
replace(TRACE, heights=np.full(400, np.nan)) -> InputError: t.csv holds 0 heights: at least 32
Trace(LEFT_OUT, 1e-6) -> InputError: the index of array leaves rows out, or has another order
Trace(['a'] * 99, 1e-06) -> InputError: array holds <U1 of 1 dimensions
replace(TRACE, step='5um') -> TypeError: step is '5um': it must be a pos
read_trace(3) -> TypeError: source is 3: it must be a path
read_trace(__file__, step=-1) -> InputError: step is -1: it must be a positive number
read_trace(__file__, columns=['a', 1]) -> TypeError: columns is 'a': it must be a whole number
read_trace(__file__, row=-1) -> InputError: row is -1: it must be
answer(prepared=TRACE) ->
    TypeError: prepared is a Trace: it must be a Prepared; make one with prepare_trace
answer(half_space=1000000.0) -> TypeError: half_space is 1000000.0: it must be a HalfSpace
answer(work_of_adhesion=-1) -> ValueError: work_of_adhesion is -1.0: it must be 0 or
answer(work_of_adhesion='0.04') ->
    TypeError: work_of_adhesion is '0.04': it must be a row of numbers
answer(work_of_adhesion=[0.04, 0.04]) -> ValueError: work_of_adhesion is [0.04, 0.04]: its values
answer(work_of_adhesion=[]) -> ValueError: work_of_adhesion is empty: it must hold one number
answer(max_penetration=[0.5, 1.0]) -> ValueError: max_penetration is 1.0: it must be
answer(processes=-1) -> ValueError: processes is -1: it must be a whole number from 0 to 4096
answer(max_stress=500.0) -> ValueError: max_stress is given, but a path under a separation
answer(quick=1) -> TypeError: quick is 1: it must be True or False
answer(watch=1) -> TypeError: watch is 1: it must be a function, or None
# files
adhesis.open(3) -> TypeError: path is 3: it must be a path
adhesis.open('a.h5', beside='b.h5') -> TypeError: beside is 'b.h5': it must be a list of paths
path([0.5, -50.0, 0.6]) -> PathError: contact is lost on the way to -50
"""
CASES = [
    case.split(" -> ")
    for case in re.sub(r"->\n +", "-> ", REFUSED).splitlines()
    if case and not case.startswith("#")
]


@pytest.mark.parametrize(("call", "end"), CASES, ids=[call for call, _ in CASES])
def test_bad_input_is_refused_in_one_sentence(call: str, end: str) -> None:
    error, sentence = end.split(": ", 1)
    names = {**{name: getattr(adhesis, name) for name in adhesis.__all__}, **globals()}
    with pytest.raises(eval(error, names)) as caught:
        eval(call, names)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "--" not in str(caught.value)


def test_the_steepest_profiles_that_methods_are_tested_with_are_not_refused() -> None:
    Problem(spectral(h_rms=None, m2=99.99**2), SOLID, 0.04)
    for period in (1e-3, 2e-3, 3e-3, 7e-3):  # whose slopes are 100 but for rounding
        Problem(spectral(h_rms=None, m2=1e4, period=period), SOLID, 0.04)
    with pytest.raises(ValueError, match=r"rms slope is 100\.1: it must be"):
        Problem(spectral(h_rms=None, m2=99.99**2).scaled(1.001), SOLID, 0.04)


def test_a_generator_of_turning_points_is_followed_and_the_order_is_kept() -> None:
    found = loops((turn for turn in (0.6, 0.3)), load_steps=2)
    assert [result.turning_point for result in found] == [0.6, 0.3]
    assert path(iter([0.5, 0.4]), load_steps=1, out=False).turning_points == (0.5, 0.4)


def test_equal_values_are_equal_and_have_equal_hashes() -> None:
    other = Problem(single_wave(AMPLITUDE, PERIOD), HalfSpace(1e6, 0.5), 0.04)
    pairs: list[tuple[Any, Any]] = [
        (WAVE, single_wave(AMPLITUDE, PERIOD)),
        (WAVE, Profile(PERIOD, [Fraction(0), Fraction(AMPLITUDE) / 2])),
        (SOLID, HalfSpace(1e6, 0.5)),
        (PROBLEM, other),
        (one_loop(), run_loop(ExactWave(other), max_penetration=0.5, load_steps=4)),
        (one_path(), replace(one_path(), seconds=0.0)),
        # how a loop was found is no part of what it found
        (one_loop(), replace(one_loop(), method=MethodReport("other", None), seconds=9.0)),
        (STATES[-1], METHOD.follow(METHOD.detached(AMPLITUDE), 0.5 * AMPLITUDE).states[-1]),
        (METHOD.fields(STATES[-1], 16), METHOD.fields(STATES[-1], 16)),
        (METHOD.openings(STATES[-1])[0], METHOD.openings(STATES[-1])[0]),
        (prepare_trace(TRACE).spectrum.noise, prepare_trace(TRACE).spectrum.noise),
    ]
    for one, two in pairs:
        assert one is not two or isinstance(one, float)
        assert (one == two) is True
        assert hash(one) == hash(two)
        assert one != 3
        for copied in (copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
            assert copied == one


def test_different_values_are_not_equal() -> None:
    pairs: list[tuple[Any, Any]] = [
        (WAVE, single_wave(AMPLITUDE, 2 * PERIOD)),
        (WAVE, WAVE.scaled(1 + 1e-15)),
        (WAVE, profile_from_heights(WAVE.heights(8), PERIOD).mirrored().shifted(0.1 * PERIOD)),
        (PROBLEM, Problem(WAVE, SOLID, 0.05)),
        (PROBLEM, Problem(WAVE, SOLID, 0.04, Control(1e9))),
        (one_loop(), loop(load_steps=5)),
        (one_loop(), replace(one_loop(), loss=2 * one_loop().loss)),
        (STATES[-1], STATES[0]),
        (one_loop(), one_loop().problem),
    ]
    for one, two in pairs:
        assert (one == two) is False


def test_a_copy_cannot_be_written_to_either() -> None:
    for copied in (
        copy.deepcopy(one_loop()),
        pickle.loads(pickle.dumps(one_loop())),
        replace(one_loop(), seconds=0.0),
    ):
        with pytest.raises(ValueError, match="read-only"):
            copied.separation[0] = 0.0


def test_an_array_that_was_given_stays_the_callers() -> None:
    given = np.array([0.0, 1e-6])
    profile = Profile(PERIOD, given)
    given[1] = 5.0
    assert profile.coefficients[1] == 1e-6


def test_warnings_are_printed_with_the_loop() -> None:
    doubtful = replace(one_loop(), loss_error=one_loop().loss)
    assert doubtful.warnings
    assert all(text in str(doubtful) for text in doubtful.warnings)
    assert "WARNING" not in str(one_loop())


def test_without_adhesion_there_is_no_residual_and_no_tension() -> None:
    """The integral is rounding: in units of itself it would be a residual of 1."""
    none = loop(method=ExactWave(Problem(WAVE, SOLID, 0.0)))
    rounding = replace(none, loss=1e-20, loss_from_drops=0.0)
    assert rounding.audit_residual == 0
    assert str(none.pull_off_stress) == "0.0"
    assert path([0.5], method=ExactWave(none.problem)).audit_residual == 0


@pytest.mark.parametrize(
    "make",
    [
        lambda zero: Control(zero),
        lambda zero: HalfSpace(1e6, zero),
        lambda zero: Problem(WAVE, SOLID, zero),
        lambda zero: real("value", zero),
    ],
)
def test_a_zero_has_no_sign(make: Callable[[float], Any]) -> None:
    """A stiffness of -0.0 is that of load control, and nothing prints "-0"."""
    assert repr(make(-0.0)) == repr(make(0.0))
    assert pickle.dumps(make(-0.0)) == pickle.dumps(make(0.0))


def test_a_penetration_within_rounding_of_first_touch_is_0() -> None:
    h_max = WAVE.h_max
    for s in (h_max, np.nextafter(h_max, 1), np.nextafter(h_max, 0)):
        assert str(PROBLEM.penetration(s)) == "0.0"
        assert PROBLEM.penetration(np.array([s, 0.5 * h_max])).tolist() == [0.0, 0.5]
    assert PROBLEM.penetration(h_max * (1 - 1e-12)) == pytest.approx(1e-12, rel=1e-3)


def test_one_is_not_several() -> None:
    assert [counted(n, "jump") for n in (0, 1, 2)] == ["0 jumps", "1 jump", "2 jumps"]
    assert f"loss={one_loop().loss:.6g} J/m²" in repr(one_loop())
    assert "2 jumps, 0 warnings" in repr(one_loop())


def test_a_command_is_answered_in_its_own_words() -> None:
    with naming_options(), pytest.raises(InputError, match=r"^--degree is 9: it must be"):
        prepare_trace(TRACE, degree=9)
    with pytest.raises(InputError, match=r"^degree is 9: it must be"):
        prepare_trace(TRACE, degree=9)
    assert issubclass(InputError, ValueError)


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_a_bound_that_a_refusal_names_is_taken(seed: int) -> None:
    """Rounded to the nearest, 9.5e-07 m was refused: it must be at most 9.5e-07 m."""
    profile = rough(3, 4, seed)

    def problem(gamma: float = 0.0123, **others: Any) -> Problem:
        return Problem(profile, SOLID, gamma, **others)

    def named(pattern: str, call: Callable[[], object]) -> list[float]:
        with pytest.raises(ValueError, match=pattern) as refusal:
            call()
        found = re.search(pattern, str(refusal.value))
        assert found
        return [float(number) for number in found.groups()]

    call = partial(make_method, "sharp", problem(strength=10.0))
    longest, least = named(r"at most (\S+) m and at least (\S+) Pa for", call)
    make_method("sharp", problem(strength=least))
    make_method("sharp", problem(adhesion_range=longest))
    for name in ("sharp", "grid"):
        call = partial(make_method, name, problem(1e29))
        for gamma in named(r"from (\S+) to (\S+) J", call):
            make_method(name, problem(gamma))
    loop = run_loop(make_method("sharp", problem()), max_penetration=0.5, load_steps=4)
    pattern = r"between (\S+) and (\S+) Pa"
    for stress in named(pattern, lambda: loop.at_stress(1e9, "unloading")):
        loop.at_stress(stress, "unloading")
