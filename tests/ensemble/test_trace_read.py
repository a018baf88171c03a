"""Reading a trace: the same heights from every kind of text, or one sentence."""

from __future__ import annotations

import copy
import dataclasses
import io
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.trace.reading.measured_trace import Trace, read_trace
from tests.support.wrong_values import WithUnit

N, STEP = 200, 0.5e-6
X = STEP * np.arange(N)
Z = 1e-7 * np.sin(2 * np.pi * X / 20e-6) + 2e-8 * np.cos(2 * np.pi * X / 3.1e-6)


def rows(
    delimiter: str, decimal: str, x: float = 1e6, z: float = 1e6, form: str = ".5f"
) -> list[str]:
    """Positions and heights as lines, in units of 1/x and 1/z metres."""
    lines = [f"{a * x:{form}}\0{b * z:{form}}" for a, b in zip(X, Z, strict=True)]
    return [line.replace(".", decimal).replace("\0", delimiter) for line in lines]


def read(tmp_path: Path, lines: list[str], **options: object) -> Trace:
    path = tmp_path / "t.txt"
    path.write_bytes("\n".join(lines).encode())
    return read_trace(path, **options)  # type: ignore[arg-type]


def assert_right(trace: Trace) -> None:
    assert trace.points == N
    assert trace.step == pytest.approx(STEP, rel=1e-6)
    np.testing.assert_allclose(trace.heights, Z, atol=1e-11)


UM = "x (µm);z (µm)"
TEXTS: dict[str, list[str]] = {
    "names and units between single spaces": ["# x (mm) h (um)", *rows(" ", ".", 1e3, 1e6, ".7f")],
    "strokes and spaces": ["# x / mm z / µm", *rows("  ", ".", 1e3, 1e6, ".7f")],
    "units in words": ["% position in mm, height in m", *rows(" ", ".", 1e3, 1, ".12f")],
    "a header with other signs": ["#x (mm); profile z (µm)", *rows("\t", ".", 1e3, 1e6, ".7f")],
    "units on a line of their own": ["Position;Profile", "mm;µm", *rows(";", ".", 1e3, 1e6, ".7f")],
    "units as keys": ["X-Unit: mm", "Z-Unit: um", "Points: 200", *rows(",", ".", 1e3, 1e6, ".7f")],
    "one unit for both": ["% Units: micrometers", "% Scan length: 0.1 mm", *rows(" ", ".")],
    "an instrument's preamble": [
        "Stylus profiler;;",
        "Date;2024-03-01 10:30 PM",
        "Stylus radius;2.5",
        "Scan length, mm;0.0995",
        "",
        "Lateral(µm);Raw(µm)",
        *rows(";", "."),
        "",
        "End of file",
    ],
    **{
        f"scientific, in metres: {said}": [said, "x z", *rows(" ", ".", 1, 1, ".9e")]
        for said in ("", "SI units", "(all in m)", "Drive unit: LD", "Cut-off (mm): none")
    },
}


@pytest.mark.parametrize("kind", TEXTS)
def test_every_usual_text_gives_the_same_heights(kind: str, tmp_path: Path) -> None:
    assert_right(read(tmp_path, TEXTS[kind]))


NAMES = [
    *("Position Height", "Distance Raw", "X1 Z1", "Weg Höhe", "Abstand Profil", "距離 高さ"),
    *("Abscisse Hauteur", "distancia altura", "Posizione Altezza", "位置 高度", "위치 높이"),
    *(
        "x R-profile",
        "Sample-position W_profile",
        "Odległość Wysokość",
        "afstand hoogte",
        "Расстояние Высота",
    ),
]
FORMS = ("{} ({})", "{} [{}]", "{} / {}", "{} in {}", "{}_{}", "{}, {}", "{} <{}>")


@pytest.mark.parametrize("names", NAMES)
def test_names_of_positions_and_heights_have_units_in_many_languages(names, tmp_path):
    for k, form in enumerate(FORMS):
        head = "\t".join(
            form.format(n, u) for n, u in zip(names.split(), ("mm", "µm"), strict=True)
        )
        decimal = ".,"[k % 2]
        assert_right(read(tmp_path, [head, *rows("\t", decimal, 1e3, 1e6, ".7f")]))


def npy(array: np.ndarray) -> io.BytesIO:
    stream = io.BytesIO()
    np.save(stream, array)
    stream.seek(0)
    return stream


TEXT = "\n".join([UM, *rows(";", ",")])
BOTH = np.column_stack([1e6 * X, 1e6 * Z])
FRAME = pd.DataFrame({"x (mm)": 1e3 * X, "z (um)": 1e6 * Z, "more": 0.0})
NAMED = FRAME.set_axis(["x", "z", "more"], axis=1)
HEIGHTS = FRAME["z (um)"]
WITH_UNITS = NAMED[["x", "z"]].copy()
WITH_UNITS.attrs["units"] = {"x": "mm", "z": "um"}
IN_MEMORY: dict[str, tuple[Callable[[], object], dict[str, object]]] = {
    "stream of text": (lambda: io.StringIO(TEXT), {}),
    "stream of bytes": (lambda: io.BytesIO(TEXT.encode("latin-1")), {}),
    "stream of an array": (lambda: npy(BOTH), {"unit": "um"}),
    "stream of an array of heights": (lambda: npy(1e6 * Z), {"unit": "um", "step": STEP}),
    "array": (lambda: BOTH, {"unit": "um"}),
    "array of two rows": (lambda: BOTH.T, {"unit": "um"}),
    "array of a map": (lambda: 1e6 * np.array([Z, -Z, Z]), {"unit": "um", "step": STEP, "row": 2}),
    "stream of three columns": (lambda: npy(BOTH[:, [0, 0, 1]]), {"unit": "um", "columns": [1, 3]}),
    "array in metres": (lambda: np.column_stack([X, Z]), {}),
    "list": (lambda: BOTH.tolist(), {"unit": "um"}),
    "heights": (lambda: 1e6 * Z, {"unit": "um", "step": STEP}),
    "whole numbers": (lambda: np.rint(1e12 * Z).astype(int) / 1e6, {"unit": "um", "step": STEP}),
    "table": (lambda: FRAME[["x (mm)", "z (um)"]], {}),
    "table, columns by name": (lambda: FRAME, {"columns": ["x (mm)", "z (um)"]}),
    "table, columns by number": (lambda: FRAME, {"columns": [1, 2]}),
    "table with units beside": (lambda: WITH_UNITS, {}),
    "one column of a table": (lambda: HEIGHTS, {"step": STEP}),
    "positions as index": (lambda: HEIGHTS.set_axis(X), {"step": STEP}),
    "rounded positions": (lambda: HEIGHTS.set_axis((1e10 * X / 3).round()), {"step": STEP}),
    "whole positions": (lambda: HEIGHTS.set_axis((1e9 * X / 3).astype(int)), {"step": STEP}),
    "slice": (lambda: pd.concat([HEIGHTS, HEIGHTS], ignore_index=True)[N:], {"step": STEP}),
    "every second row": (lambda: HEIGHTS.repeat(2).reset_index(drop=True)[::2], {"step": STEP}),
    "reversed order": (lambda: HEIGHTS[::-1].reset_index(drop=True)[::-1], {"step": STEP}),
}


@pytest.mark.parametrize("kind", IN_MEMORY)
def test_streams_arrays_and_tables_give_the_heights_that_files_give(kind: str) -> None:
    make, options = IN_MEMORY[kind]
    trace = read_trace(make(), **options)  # type: ignore[arg-type]
    assert_right(trace)
    assert ("their index has" in trace.notes[0]) == ("positions" in kind or "every" in kind)
    assert pickle.loads(pickle.dumps(trace)) == copy.deepcopy(trace) == trace


def test_an_open_file_is_named_and_read(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text(TEXT, encoding="utf-8")
    for stream in (path.open("rb"), path.open(encoding="utf-8")):
        with stream:
            trace = read_trace(stream)
        assert_right(trace)
        assert trace.source == str(path)


def test_whole_heights_in_memory_are_no_step_and_no_length() -> None:
    heights = np.arange(N) * 7 % 11
    assert read_trace(heights, unit="nm", step=7e-9).points == N


def test_rows_that_a_column_of_a_table_marks_are_gaps() -> None:
    valid = np.arange(N) != 7
    for marks in (valid, valid.astype(int)):
        table = FRAME.assign(valid=marks)
        for columns in ([1, 2], ["x (mm)", "z (um)"]):
            trace = read_trace(table, columns=columns)
            assert np.flatnonzero(np.isnan(trace.heights)).tolist() == [7]
    for columns in ([1, 4], ["x (mm)", "valid"]):
        with pytest.raises(InputError, match="'valid' of the table holds bool"):
            read_trace(FRAME.assign(valid=valid), columns=columns)


def test_columns_that_are_not_chosen_may_hold_anything_and_show_a_raster() -> None:
    others = {"name": "a", "time": pd.Timestamp(0), "done": True, "more": np.arange(N) % 2}
    for columns in ([1, 2], ["x (mm)", "z (um)"]):
        trace = read_trace(FRAME.assign(**others), columns=columns)
        assert_right(trace)
        assert "column 3 (more) holds 0 and 1 alone: it is not used" in trace.notes
    raster = pd.concat([FRAME, FRAME], ignore_index=True)
    for columns in ([2], ["z (um)"]):
        with pytest.raises(InputError, match="it is a raster of 2 lines of 200 points"):
            read_trace(raster, columns=columns, step=STEP)
        assert_right(read_trace(raster, columns=columns, step=STEP, row=1))


def test_missing_heights_in_memory_are_gaps() -> None:
    masked = np.ma.masked_array(1e6 * Z, mask=np.arange(N) == 7)
    table = pd.DataFrame({"z (um)": pd.array([None, *(1e6 * Z[1:])], dtype="Float64")})
    for source, gap in ((masked, 7), (table, 0)):
        trace = read_trace(source, unit="um", step=STEP)
        assert np.flatnonzero(np.isnan(trace.heights)).tolist() == [gap]


WORDS = FRAME.assign(**{"z (um)": "high"})


TWO_UNITS = FRAME.copy()
TWO_UNITS.attrs["units"] = {"z (um)": "nm"}
ONE_UNIT = NAMED[["x", "z"]].copy()
ONE_UNIT.attrs["units"] = "um"

REFUSED_IN_MEMORY: dict[str, tuple[object, dict[str, object], type[Exception], str]] = {
    "no unit": (BOTH, {}, InputError, "array states no unit"),
    "no step": (Z, {"unit": "m"}, InputError, "array has heights without positions.*give step"),
    "three columns": (FRAME, {}, InputError, "the table has 3 columns: give columns X,Z"),
    "no such column": (FRAME, {"columns": ["x", "z"]}, InputError, r"columns is 'x': the table ha"),
    "words": (WORDS, {"columns": [1, 2]}, InputError, "the table holds more than numbers"),
    "complex": (1j * Z, {"step": STEP}, InputError, "array holds complex128"),
    "a unit of its own": (BOTH.view(WithUnit), {"unit": "mm"}, TypeError, "array carries a unit"),
    "rows left out": (HEIGHTS.drop(9), {"step": STEP}, InputError, r"leaves rows .*\(drop=True\)"),
    "by name": (FRAME.drop(9), {"columns": ["z (um)"], "step": STEP}, InputError, "leaves rows"),
    "another order": (HEIGHTS.sort_values(), {"step": STEP}, InputError, "another order"),
    "units in a list": (list(BOTH.T.view(WithUnit)), {"unit": "mm"}, TypeError, "array carries a"),
    "a map": (np.zeros((99, 98)), {}, InputError, "98 columns: .* or row K"),
    "a row": (BOTH, {"row": 1, "unit": "um"}, InputError, "row is 1: array is no map, as its pos"),
    "a decimal sign": (BOTH, {"decimal": ","}, InputError, "decimal belongs to files"),
    "an empty stream": (io.BytesIO(b""), {}, InputError, "the stream is empty"),
    "a zip": (io.BytesIO(b"\x1f\x8b0"), {}, InputError, "the stream is compressed"),
    "booleans": (FRAME.assign(**{"z (um)": True}), {"columns": [1, 2]}, InputError, "holds bool"),
    "one unit": (ONE_UNIT, {}, InputError, r"attrs\['units'\] of the table is 'um': it must map"),
    "two units": (
        TWO_UNITS,
        {"columns": ["x (mm)", "z (um)"]},
        InputError,
        r"column 'z \(um\)' of the table has the unit nm in attrs: correct the wrong one",
    ),
    "no rows": (np.zeros((0, 2)), {"unit": "um"}, InputError, "array holds 0 rows of numbers"),
    "ragged": ([[1.0, 2.0], [3.0]], {}, InputError, "array is no table of numbers: "),
    "a unit that is none": (BOTH, {"unit": 5}, TypeError, "unit is 5: it must be a text"),
    **{
        f"{type(found).__name__} of xarray": (found, {"step": STEP}, TypeError, "a path, .* list")
        for found in (xr.DataArray(Z), xr.Dataset({"z": ("x", Z)}))
    },
    "one column number": (BOTH, {"columns": 1}, TypeError, r"columns is 1: it must be a list"),
    "a text for a path": ("1,2\n3,4\n", {}, InputError, r"cannot read 1,2\\n3,4\\n: there is no"),
}


@pytest.mark.parametrize("kind", REFUSED_IN_MEMORY)
def test_what_is_in_doubt_in_memory_is_refused(kind: str) -> None:
    source, options, error, words = REFUSED_IN_MEMORY[kind]
    with pytest.raises(error, match=words):
        read_trace(source, **options)  # type: ignore[arg-type]


def test_a_trace_is_made_of_heights_and_a_step() -> None:
    trace = Trace(np.ma.masked_array(Z, mask=np.arange(N) == 7), STEP)
    assert repr(trace).startswith("Trace(array: 200 points, step 500 nm, length 99.5 µm, range 23")
    assert repr(trace).endswith("nm, 1 drop-out)")
    assert not trace.heights.flags.writeable
    for change, words in (
        ({"heights": Z[:9]}, "array holds 9 heights: at least 32"),
        ({"heights": np.zeros(N)}, "every height is 0 m"),
        ({"heights": np.zeros((2, N))}, "array holds numbers of 2 dimensions"),
        ({"step": 0.0}, "step is 0"),
        ({"step": 1.0}, "would be 199 m long"),
        ({"tip_radius": -1.0}, "tip_radius is -1"),
    ):
        with pytest.raises(InputError, match=words):
            dataclasses.replace(trace, **change)


@pytest.mark.parametrize(
    "gap",
    ["", "NaN", "---", "*****", "*", "x", "BAD", "-9999", "1e38", "-nan(ind)", "1.#QNAN0",
     "Infinity", "n.a.", "(no data)", "Over range", "#WERT!", "#DIV/0!", "#N/A"],
)  # fmt: skip
def test_drop_outs_are_gaps_however_they_are_written(gap: str, tmp_path: Path) -> None:
    lines = rows(";", ".")
    for k in (20, 21, 77):
        lines[k] = lines[k].split(";")[0] + ";" + gap
    trace = read(tmp_path, [UM, *lines])
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(trace.heights)), [20, 21, 77])
    if gap:  # two empty lines end a block
        column = [line.split(";")[1] for line in lines]
        assert read(tmp_path, ["z (um)", *column], step=STEP).drop_outs == 3
    good = ~np.isnan(trace.heights)
    np.testing.assert_allclose(trace.heights[good], Z[good], atol=1e-11)


def test_positions_that_do_not_begin_at_nought_are_pointed_out(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    for begin, said in ((0.0, False), (7.5, True), (-49.75, True)):
        table = np.column_stack([begin + 1e6 * X, 1e6 * Z])
        np.savetxt(path, table, "%.5f", delimiter=",", header="x (um),z (um)")
        note = (
            f"positions begin at {begin:g} µm: those named below, and those to exclude, count "
            "from there"
        )
        assert (note in read_trace(path).notes) == said


def test_backward_and_slightly_uneven_positions(tmp_path: Path) -> None:
    trace = read(tmp_path, [UM, *rows(";", ".")[::-1]])
    assert_right(trace)
    assert any("backwards" in note for note in trace.notes)
    uneven = X + 0.2 * STEP * np.sin(np.arange(N) / 20)  # a scanner that drifts
    slow = 1e-7 * np.sin(2 * np.pi * uneven / 20e-6)
    lines = [f"{a * 1e6:.6f} {b * 1e6:.6f}" for a, b in zip(uneven, slow, strict=True)]
    trace = read(tmp_path, lines, unit="um")
    assert any("unequal steps" in note for note in trace.notes)
    even = np.linspace(uneven[0], uneven[-1], N)
    np.testing.assert_allclose(trace.heights, 1e-7 * np.sin(2 * np.pi * even / 20e-6), atol=1e-9)
