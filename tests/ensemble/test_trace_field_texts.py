"""Texts as instruments, spreadsheets and people write them: read as meant, or refused by name."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.loop.heights import read_heights
from adhesis.ensemble.trace.prepare import prepare_trace
from adhesis.ensemble.trace.reading.header_units import step_of_header
from adhesis.ensemble.trace.reading.measured_trace import read_trace

N, STEP = 400, 0.5e-6
PLACE = np.arange(N)
XS = [f"{0.5 * k:.3f}" for k in PLACE]
ZS = [f"{z:.6f}" for z in 0.5 * np.sin(PLACE / 9) + 0.2 * np.cos(PLACE / 2.3)]
Z = 1e-6 * np.array(ZS, dtype=float)
PAIRS = list(zip(XS, ZS, strict=True))
UM = "x (um),z (um)"
TWO = [f"{x},{z}" for x, z in PAIRS]
ROWS = [f"{x};{z}" for x, z in PAIRS]
RU = [row.replace(",", ";").replace(".", ",") for row in TWO]


def grouped(sign: str) -> list[str]:
    """Rows in nm whose positions have signs of thousands."""
    return [f"{500 * k:,};{1e3 * float(z):.3f}".replace(",", sign) for k, z in enumerate(ZS)]


def put(path: Path, text: str | Iterable[str] | bytes, encoding: str = "utf-8") -> Path:
    if not isinstance(text, str | bytes):
        text = "\n".join([*text, ""])
    path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    return path


Z_UM = {"unit": "um", "step": STEP}
# A text, or a text and options. Other encodings, delimiters, quotes, blanks and headers:
# test_trace_variations.py.
READ: dict[str, Any] = {
    "quoted, decimal commas": [UM, *(f'"{x}","{z}"'.replace(".", ",") for x, z in PAIRS)],
    "a count beside units in lines of their own": (
        ["Unit: um", "Spacing = 0.5 um", "No.;z", *(f"{k};{z}" for k, z in enumerate(ZS))],
    ),
    "a count without a name beside units in lines": (
        ["X unit: cm", "Z unit: um", "dx = 0.5 um", ";z"]
        + [f"{k};{z}" for k, z in enumerate(ZS, 1)],
    ),
    "a sentence with a unit above a count": (
        ["Data in meter", ";z", *(f"{k};{z}E-6;" for k, z in enumerate(ZS))],
        {"step": STEP},
    ),
    "a count below a length whose words are no names": (
        ["X resolution,9,um", "DataLine,POS = 0", *(f"{k},{z}" for k, z in enumerate(ZS))],
        Z_UM,
    ),
    "Å behind a name": ["Lateral um,Raw Å,", *(f"{x},{1e4 * float(z):.2f}," for x, z in PAIRS)],
    "a unit in Japanese": ["測定ピッチ,0.5,um", "単位,um", "データ", *ZS],
    "units by option": ([f"{x} {z}" for x, z in PAIRS], {"unit": "um"}),
    "units by option below those of results": (["Ra;nm", "Lc;mm", "x;z", *ROWS], {"unit": "um"}),
    "labels and their units": ["Unit X;um", "Unit Z;um", "x;z", *ROWS],
    "inches and their parts": (
        ["X (in),Z (µin)", *(f"{k / 50_800:.12f},{z / 25.4e-9:.9f}" for k, z in enumerate(Z))],
    ),
    "quoted names with delimiters": ['"x, along (um)","z, up (um)"', *TWO],
    "rows of empty fields between": ["x (um)\tz (um)", *(f"\t\n{x}\t{z}" for x, z in PAIRS)],
    "an empty column before": [f",{UM}", *(f",{row}" for row in TWO)],
    "a count and an interval in quotes": (
        [
            '"Measurement data interval","0.5","um"',
            '"No.","Height (um)"',
            *(f'"{k}","{z}"' for k, z in enumerate(ZS, 1)),
        ],
    ),
    "a lone column": (
        ["No.,Height (um)", *(f"{k},{z}" for k, z in enumerate(ZS, 1))],
        {"columns": [2], "step": STEP},
    ),
    "a count of another name": (
        ["Pitch: 0.5 um", "a,b", *(f"{k},{z}" for k, z in enumerate(ZS, 1))],
        {"unit": "um"},
    ),
    "a named count from ten on": (
        ["Nr.;Höhe (um)", *(f"{k};{z}" for k, z in enumerate(ZS, 10))],
        {"step": STEP},
    ),
    "names and units in Cyrillic": ["Расстояние, мкм;Высота, мкм", *RU],
    "a count of points above": (["Points: 400", "x y", *TWO], {"unit": "um"}),
    "a count without a name": (
        [",z (um)", *(f"{k:.1f},{z}" for k, z in enumerate(ZS))],
        {"unit": "um", "step": STEP},
    ),
    "a column that marks": (
        ["X;Z;valid", "[um];[um];[1/0]", *(f"{row.replace(',', ';')};1" for row in TWO)],
        {"columns": [1, 2]},
    ),
    "a row of a map": (
        ["# Value units: um", "\t".join(ZS[::-1]), "\t".join(ZS), "\t".join(ZS[::-1])],
        {"row": 1, "step": STEP},
    ),
    "a line of a raster": (
        [f"{XS[k]},{y},{zs[k]}" for y, zs in enumerate((ZS[::-1], ZS)) for k in range(N)],
        {"unit": "um", "columns": [1, 3], "row": 1},
    ),
    "a map whose rows differ by the same height": (
        ["\t".join(f"{float(z) + 0.01 * k:.6f}" for z in ZS) for k in (-1, 0, 1)],
        {"row": 1, **Z_UM},
    ),
    "a line of a raster below a line with a unit": (
        ["# Value units: um", *(f"{x} {y} {z}" for y in range(3) for x, z in PAIRS)],
        {"unit": "um", "columns": [1, 3], "row": 1},
    ),
    "a line of the heights of a raster that lacks its first one": (
        [f"{XS[k]},{y},{ZS[k] if y + k else 'nan'}" for y in range(2) for k in range(N)],
        {"columns": [3], "row": 1, **Z_UM},
    ),
    "an option against a line that names no column": (
        ["Evaluation length in mm", *TWO],
        {"unit": "um"},
    ),
    "a mark of UTF-8 behind the header": [UM, f"\ufeff{TWO[0]}", *TWO[1:]],
    "decimal commas of three digits": (
        ["dx: 500 nm", "Z (nm)", *(f"{1e3 * float(z):.3f}".replace(".", ",") for z in ZS)],
    ),
    "ruled comments": ["####", "# x", "####", UM, *TWO],
    "blank lines before": [*(5000 * [""]), UM, *TWO],
    "a delimiter before": ["\tx (um)\tz (um)", *(f"\t{x}\t{z}" for x, z in PAIRS)],
    "names by number beside an index": (
        [",0,1", *(f"{k},{row}" for k, row in enumerate(TWO))],
        {"unit": "um", "columns": [2, 3]},
    ),
    "an index and a name by number": ([",0", *(f"{k},{z}" for k, z in enumerate(ZS))], Z_UM),
    "numbers of rows that R names nothing": (
        ['"z"', *(f'"{k}" {z}' for k, z in enumerate(ZS, 1))],
        Z_UM,
    ),
    "a label, a value and a unit in quotes": (['"Z Calibration","1","nm"', "Height", *ZS], Z_UM),
    "words that mark rows": (
        ["x (um),z (um),valid", *(f"{row},{k < N}" for k, row in enumerate(TWO))],
        {"columns": [1, 2]},
    ),
    "a nought without decimals at the first place": ["x (um),z (um)", f"0,{ZS[0]}", *TWO[1:]],
    "names in brackets": (
        ["Position (X),Height (Z)", *(f"{5e-7 * k:.7f},{z:.12f}" for k, z in enumerate(Z))],
    ),
    "brackets beside units in lines": ["X-Unit: um", "Z-Unit: um", "Data (raw),Profile (Rz)", *TWO],
    "heights beside directions": (
        [f"{x},{k % 2},{z}" for k, (x, z) in enumerate(PAIRS)],
        {"columns": [3], **Z_UM},
    ),
    "page breaks": ([f"\f{z}" if k % 60 == 59 else z for k, z in enumerate(ZS)], Z_UM),
}  # fmt: skip


@pytest.mark.parametrize("kind", READ)
def test_what_is_meant_is_read(kind: str, tmp_path: Path) -> None:
    case = READ[kind]
    text, *options = case if isinstance(case, tuple) else [case]
    trace = read_trace(put(tmp_path / "t.txt", text), **dict(*options))
    assert trace.points == N
    assert trace.step == pytest.approx(STEP, rel=1e-9)
    np.testing.assert_allclose(trace.heights, Z, rtol=0, atol=1e-15)


def test_delimiters_of_whole_numbers_are_no_decimal_signs(tmp_path: Path) -> None:
    rows = [f"{500 * k},{1e3 * float(z):.0f}" for k, z in enumerate(ZS)]
    of_r = ['"x","z"', *(f'"{k}",{row}' for k, row in enumerate(rows, 1))]
    trace = read_trace(put(tmp_path / "t.csv", of_r), unit="nm", columns=[2, 3])
    np.testing.assert_allclose(trace.heights, Z, rtol=0, atol=5.1e-10)
    of_map = ["Line 1, raw", *3 * [",".join(row.split(",")[1] for row in rows[:399])]]
    line = read_trace(put(tmp_path / "t.csv", of_map), unit="nm", step=STEP, row=1)
    assert np.array_equal(line.heights, trace.heights[:399])
    behind = ["x (nm),z (nm)", *(f"{row}," for row in rows)]
    assert np.array_equal(read_trace(put(tmp_path / "t.csv", behind)).heights, trace.heights)


@pytest.mark.parametrize(
    ("codes", "missing"),
    [
        ({50: "-99.99", 51: "-99.99", 52: "-99.99", 200: "99.99", 201: "99.99", 202: "99.99"}, 6),
        ({50: "-99999.9999", 90: "-99999.9998", 130: "-99999.9997", 131: "-99999.9996"}, 4),
        ({50: "-9999", 51: "-9999", 200: "9999", 201: "9999"}, 4),
        ({50: "-32768", 200: "32767"}, 2),
        ({50: "0.000", 51: "0.000", 200: "0.000"}, 3),
        ({50: "12.5", 51: "12.5", 52: "12.5", 200: "-13.5", 201: "-13.5", 202: "-13.5"}, 6),
        ({50: "-9.99", 200: "9.99"}, 2),
        ({50: "-3.2768", 51: "-3.2768", 200: "-3.2768"}, 3),
        ({50: "5.0", 51: "5.0", 52: "5.0", 200: "-5.0", 201: "-5.0", 202: "-5.0"}, 6),
        ({k: ("-99.9999", "-99.9998")[k % 2] for k in range(50, 66)}, 16),
        ({k: f"-20.00{k % 3}0" for k in range(50, 66)}, 0),  # a smooth floor
        (dict.fromkeys(range(50, 56), "-1.2"), 0),  # the floor of a groove
        ({50: "0.800", 51: "0.800", 52: "0.800"}, 0),  # the flat top of a grain
        ({50: "9.1", 51: "9.2", 52: "9.2", 53: "9.2", 54: "9.3"}, 0),  # one that is high
        ({k: f"{0.5 * np.sin(np.pi * k / 10):.6g}" for k in range(N)}, 0),  # 40 are 1e-16 or so
        ({50: "12.5", 200: "-13.5"}, 0),  # two grains of dust are no codes
        ({k: ("0.00", "0.11")[k % 2] for k in (50, 61, 70, 81, 90, 101)}, 0),  # rounded heights
    ],
)
def test_all_codes_of_missing_heights_are_drop_outs(codes, missing, tmp_path):
    rows = [f"{x},{codes.get(k, z)}" for k, (x, z) in enumerate(PAIRS)]
    trace = read_trace(put(tmp_path / "t.csv", [UM, *rows]))
    gaps = np.flatnonzero(np.isnan(trace.heights)).tolist()
    assert gaps == (list(codes) if missing else [])
    assert any(f"{missing} heights of" in note for note in trace.notes) == (missing > 0)


def test_rows_that_a_column_marks_are_drop_outs_and_a_refusal_says_so(tmp_path: Path) -> None:
    def rows(marked: range = range(40, 43)) -> list[str]:
        return [f"{UM},valid", *(f"{row},{int(k not in marked)}" for k, row in enumerate(TWO))]

    lines = rows()
    lines[11] = lines[11][:-1]  # one row has no flag
    trace = read_trace(put(tmp_path / "t.csv", lines), columns=[1, 2])
    assert np.flatnonzero(np.isnan(trace.heights)).tolist() == [40, 41, 42]
    other = [row.replace("valid", "flag") for row in [*rows()[:-1], f"{TWO[-1]},2"]]
    trace = read_trace(put(tmp_path / "t.csv", other), columns=[1, 2])
    assert "column 3 (flag) holds 0 and 1 and 2 alone: it is not used" in trace.notes
    for good, bad in ("255", "0"), ("1", "-1"), ("True", "False"), ("ok", "NG"):
        words = [re.sub(",1$", f",{good}", re.sub(",0$", f",{bad}", row)) for row in rows()]
        trace = read_trace(put(tmp_path / "t.csv", words), columns=[1, 2])
        assert np.flatnonzero(np.isnan(trace.heights)).tolist() == [40, 41, 42]
        flags = [row.replace("valid", "quality") for row in words]
        (note,) = read_trace(put(tmp_path / "t.csv", flags), columns=[1, 2]).notes[1:2]
        assert re.fullmatch(r"column 3 \(quality\) holds .* and .* alone: it is not used", note)
    degrees = [re.sub(r"^(\d+\.0.*),1$", r"\1,2", row) for row in rows()]
    trace = read_trace(put(tmp_path / "t.csv", degrees), columns=[1, 2])
    assert np.flatnonzero(np.isnan(trace.heights)).tolist() == [40, 41, 42]
    empty = [row.removesuffix(",0") for row in rows()]
    trace = read_trace(put(tmp_path / "t.csv", empty), columns=[1, 2])
    assert "column 3 (valid) holds 1 and empty fields alone: it is not used" in trace.notes
    path = put(tmp_path / "t.csv", rows(range(40, 100)))
    with pytest.raises(InputError, match=r"lacks 15\.0 % .*; 60 heights marked 0 in column 3 \(va"):
        prepare_trace(read_trace(path, columns=[1, 2]))


def test_whole_numbers_between_commas_are_read_below_a_name_each(tmp_path: Path) -> None:
    rows = [f"{k},{500 + k * k % 77},7,1" for k in range(99)]
    path = put(tmp_path / "t.csv", ["x (um),z (nm),raw,mask", *rows])
    trace = read_trace(path, columns=[1, 2])
    assert trace.step == pytest.approx(1e-6)
    assert trace.heights == pytest.approx([1e-9 * (500 + k * k % 77) for k in range(99)])


@pytest.mark.parametrize("missing", [[50], [7, 50, 51]])
def test_quotes_about_nothing_are_a_missing_height_of_pandas(missing, tmp_path):
    table = pd.DataFrame({"z (um)": [float(z) for z in ZS]})
    table.iloc[missing] = np.nan
    table.to_csv(tmp_path / "t.csv", index=False, float_format="%.6f")
    trace = read_trace(tmp_path / "t.csv", step=STEP)
    assert np.flatnonzero(np.isnan(trace.heights)).tolist() == missing


def test_a_row_of_words_for_missing_numbers_keeps_its_place(tmp_path: Path) -> None:
    rows = ["n;x (um);z (um)", *(f"{k};{x};{z}" for k, (x, z) in enumerate(PAIRS))]
    rows[51] = "NaN;NaN;NaN"
    trace = read_trace(put(tmp_path / "t.csv", rows), columns=[3], step=STEP)
    assert np.flatnonzero(np.isnan(trace.heights)).tolist() == [50]
    assert np.array_equal(np.delete(trace.heights, 50), np.delete(Z, 50))
    rows[51] = ";;"
    assert read_trace(put(tmp_path / "t.csv", rows), columns=[2, 3]).points == N
    with pytest.raises(InputError, match=r"empty lines .* 1 place, .* line 52: .* columns X,Z"):
        read_trace(tmp_path / "t.csv", columns=[3], step=STEP)
    of_map = [" ".join(ZS[k : k + 40]) for k in range(0, 400, 40)]
    of_map[2] = " ".join(["nan"] * 40)
    trace = read_trace(put(tmp_path / "t.txt", of_map), row=3, unit="um", step=STEP)
    assert np.array_equal(trace.heights, Z[120:160])
    of_map[2] = ""
    put(tmp_path / "t.txt", of_map)
    with pytest.raises(InputError, match=r"empty lines .* on line 3: write NaN.* the others"):
        read_trace(tmp_path / "t.txt", row=3, unit="um", step=STEP)
    trace = read_trace(tmp_path / "t.txt", row=1, unit="um", step=STEP)
    assert np.array_equal(trace.heights, Z[40:80])
    counted = ["#;z (um)", *(f"{k};{z}" for k, z in enumerate(ZS))]
    trace = read_trace(put(tmp_path / "t.csv", [*counted[:9], "", *counted[9:]]), step=STEP)
    assert "1 empty row left out" in trace.notes
    double = "\n\n".join([*counted[:50], ";", *counted[51:]])
    with pytest.raises(InputError, match=r"unevenly at 1 place, the first on line 101"):
        read_trace(put(tmp_path / "t.csv", double), columns=[2], step=STEP)


@pytest.mark.parametrize(
    ("step", "decimals"), [(0.156, 1), (0.25, 0), (1.08, 0), (0.37, 0), (3.3, 0)]
)
def test_positions_that_are_rounded_in_print_have_equal_steps(step, decimals, tmp_path):
    rows = [f"{step * k:.{decimals}f},{z}" for k, z in enumerate(ZS)]
    for lines in (rows, rows[::-1]):
        trace = read_trace(put(tmp_path / "t.csv", [UM, *lines]))
        assert trace.points == N
        assert trace.step == pytest.approx(1e-6 * step, rel=1e-9)
        assert any("positions rounded to" in note for note in trace.notes)
        assert trace.drop_outs == 0


@pytest.mark.parametrize("form", ["{}", "{}.0"])
@pytest.mark.parametrize("name", ["Index", "a", ""])
def test_points_that_a_count_leaves_out_are_drop_outs(name, form, tmp_path):
    missing = [7, 50, 51, 90]
    rows = [f"{form.format(k)},{z}" for k, z in enumerate(ZS) if k not in missing]
    trace = read_trace(put(tmp_path / "t.csv", [f"{name},z (um)", *rows]), step=1e-6)
    assert np.flatnonzero(np.isnan(trace.heights)).tolist() == missing
    assert (trace.points, trace.step) == (N, 1e-6)
    # Of positions longer steps are rows left out; a step of 1.0025 would explain one as well.
    for step, left_out in (1.0, [200]), (1 / 3, missing):
        rows = [f"{step * (17 + k):.9f},{z}" for k, z in enumerate(ZS) if k not in left_out]
        trace = read_trace(put(tmp_path / "t.csv", [UM, *rows]))
        assert np.flatnonzero(np.isnan(trace.heights)).tolist() == left_out
        assert trace.step == pytest.approx(1e-6 * step)


SMD = [
    "ISO 5436-2:2012 s1", "PRF 1 ISO5436", "CX I 400 mm 1.0e0 D 5.00000e-04",
    "CZ A 400 um 1.0e0 D", "\x03", "DATE: 01-Feb-2020", "\x03", *ZS, "\x03", "34582", "\x03",
]  # fmt: skip
SDF = ["NumPoints = 400", "Xscale = 5e-07", "Zscale = 1e-6", "*", *ZS, "*", "UserComment = x", "*"]
BLOCK = ["Roughness profile (um)", *ZS]
APART = "the first on line 401: write NaN where"
# A text, options if it has some, and words of the refusal.
REFUSED: dict[str, tuple[Any, ...]] = {
    "two steps": (["Step: 9 nm", "Spacing: 0.5 um", "Z (um)", *ZS], "9 nm and 500 nm: give"),
    "names of two tables": ([UM, "Lc (mm),Ls (um)", *TWO], "no unit that is clear, with .Lc"),
    **{
        f"a unit more: {head}": ([*head, *TWO], "states no unit that is clear")
        for head in (["Units: mm", UM], ["Z-Unit: nm", UM], [UM, "mm,nm"])
    },
    "another unit": (["Stylus travel in mm", "Data", *ZS], {"step": STEP}, "states no unit"),
    "a step with a point of thousands": (
        ["Schrittweite: 1.000 nm", "Höhe (µm)", *(z.replace(".", ",") for z in ZS)],
        "no step with its unit",
    ),
    "a count on top": (["400", *ZS], Z_UM, "line 1 of .* has '400', at the end of a column"),
    "a step on top": (["0.500", *ZS], Z_UM, r"line 1 of .* has '0\.500', at the end of a column"),
    "a step on top, printed alike": (["0.500000", *ZS], Z_UM, "line 1 .* the step or the length"),
    "a length on top, in mm": (["0.199500", *ZS], Z_UM, "line 1 .* the step or the length"),
    "a checksum below": ([*ZS, "34582"], Z_UM, "line 401 of .* has '34582'"),
    "a length below, trimmed": (
        ["z (um)", *(f"{float(z):.1g}" for z in ZS[50:]), "175"],
        {"step": STEP},
        "line 352 of .* is 175, and the step or the length of the trace is 175 µm",
    ),
    "a count below, trimmed": (
        ["z (um)", *(f"{float(z):.1g}" for z in ZS), "400"],
        {"step": 0.3e-6},
        "line 402 of .* has '400', at the end of a column",
    ),
    "two traces, point by point": (
        [UM, *(f"{2 * (k // 2)},{float(z) + k % 2}" for k, z in enumerate(ZS))],
        "every position of .* is there 2 times, and the heights jump between them: keep the rows",
    ),
    "a count on top of positions": (["400", *TWO], {"unit": "um"}, "line 1 of .* is '400', above"),
    "two blocks": (["Step: 0.5 um", "z (um)", *ZS, *BLOCK], "lines 3 to 402; .* line 404"),
    "two blocks, marked": (["z (um)", *ZS, "# more", *ZS], Z_UM, "line 402 .* '# more': it ends"),
    "rows of another form below empty lines": (
        ["x (um);z (um)", *(f'"{x}";{z}\n' for x, z in PAIRS[:99])]
        + [f'"1Ê{x}";{z}\n' for x, z in PAIRS[99:]],
        r"line 200 of .* it ends the rows of 2 numbers",
    ),
    "a shorter block below": ([UM, *TWO, "Raw", *ZS], "line 402 .* follow on line 403"),
    "two blocks of two columns": ([UM, *TWO, UM, *TWO], "line 402 .* it ends the rows of 2"),
    "brackets for minus": (
        [f"({k - 200:.3f})" if k > 200 else f"{200 - k:.3f}" for k in PLACE],
        {"unit": "nm", "step": STEP},
        r"line 202 .* '\(1\.000\)': it ends the rows of one number",
    ),
    "marked rows below": ([*ZS[:300], *(f"B {z}" for z in ZS[300:])], Z_UM, "'B .*in their digits"),
    "a factor above": (["z =", "", "  1.0e-03 *", "", *ZS], Z_UM, "multiply the numbers by this"),
    "a raised mark": ([UM, *TWO[:9], f"{TWO[9]}²", *TWO[10:]], "line 11 .* ends the rows"),
    "a column named A": (["x (um),A", *TWO], "unit of the positions alone"),
    "a resolution": (["Vertical resolution (nm)", "Data", *ZS], {"step": STEP}, "states no unit"),
    "a damaged row": ([UM, *TWO[:9], "4.500,-0.1.5", *TWO[10:]], "line 11 .* ends the rows"),
    "a damaged last height": ([*ZS[:-1], "0.5l"], Z_UM, r"line 400 .* is '0\.5l'"),
    "a damaged first row": ([UM, "0.000,-0.5l", *TWO[1:]], "line 2 of .* above the numbers"),
    "SMD": ("\r\n".join(SMD), r"ISO 5436-2 \(SMD\).* export the trace as text"),
    "SMD, marked": ("\n".join(SMD).replace("\x03", "#\x03"), Z_UM, r"ISO 5436-2 \(SMD\)"),
    "SMD with zero bytes": ("\0\n".join(SMD).encode(), Z_UM, r"ISO 5436-2 \(SMD\)"),
    "its heights and checksum": ([*ZS, "#\x03", "34582"], Z_UM, "line 401 .* it ends the rows"),
    "SDF, spaced": (["aBCR - 1.0", *SDF], r"a variant of SDF \(ISO 25178-71\)"),
    "SDF without a dash": ([" aISO 1.0", *SDF], Z_UM, r"a variant of SDF \(ISO 25178-71\)"),
    "Korean": ("\n".join(["위치(㎛),높이(㎛)", *TWO]).encode("cp949"), "states no unit"),
    "thousands by blanks in one column": (
        ["z (nm)", *(f"{2e4 + 1e4 * float(z):,.2f}".replace(",", " ") for z in ZS)],
        "unit of the heights alone: .* or take signs of thousands out if all numbers are heights",
    ),
    "other signs of thousands": (["x (nm);z (nm)", *grouped("`")], "line 4 .* of thousands"),
    "thousands by blanks": (["x (nm);z (nm)", *grouped("\u202f")], "line 4 .* of thousands"),
    "thousands by points": (
        [f"{500 * k:,};{1e3 * float(z):.0f}".replace(",", ".") for k, z in enumerate(ZS)],
        {"unit": "nm"},
        r"such as '1\.000', and none whose '\.' is a decimal sign for certain: give decimal",
    ),
    "perhaps thousands by commas": (
        ["Step: 0.5 um", "z (nm)", *(f"{5e3 + 1e3 * float(z):,.0f}" for z in ZS)],
        r"such as '5,200', and none whose ',' is a decimal sign for certain: give decimal",
    ),
    "perhaps thousands in both columns": (
        ["x (nm);z (nm)", *(f"{1000 + 500 * k:,};{9 + float(z):.3f}".replace(".", ",")
                           for k, z in enumerate(ZS))],
        r"such as '1,000', and none whose ',' is a decimal sign for certain: give decimal",
    ),
    "UTF-16 without a mark": (
        "\n".join([UM, *TWO]).encode("utf-16-le"),
        {"columns": [1, 2]},
        "columns belongs to texts: .* UTF-16 without a mark, is to be saved as UTF-8",
    ),
    "numbers within apostrophes": (
        [UM, *(f"'{x}','{z}'" for x, z in PAIRS)],
        r"no line of numbers: most digits stand on line \d+, .*'\d",
    ),
    "units within the cells": (
        ["x;z", *(f"{x} um;{z} um" for x, z in PAIRS)],
        r"line 2 of .* has '0\.000 um', which is no number .* units within cells",
    ),
    "a shorter trace between spaces": (
        [*(f"{x} {z} {x} {z}" for x, z in PAIRS), "      200.0 0.1"],
        {"unit": "um", "columns": [1, 2]},
        "line 401 .* which of the 4 columns are missing cannot be seen",
    ),
    "a raster": (
        [f"{x},{y},{z}" for y in range(3) for x, z in PAIRS],
        {"unit": "um", "columns": [1, 3]},
        "line 401: it is a raster of 3 lines of 400 points, of which row K takes one",
    ),
    "a word for a height": (
        ["x (um),z (um),I", *(f"{x},{'NG' if x == '20.000' else z},5" for x, z in PAIRS)],
        {"columns": [1, 2]},
        "line 42 .*'20.000,NG,5': write NaN for a number that is missing, and no word",
    ),
    "words for heights of a map": (
        [",".join(["0.1", "NG", *ZS])] * 3,
        {"row": 1, **Z_UM},
        "line 1 of .* has 'NG', which is no number",
    ),
    "a row without its position": (
        ["x (nm);z (nm)", *(f"{500 * k};{1e3 * float(z):.0f}" for k, z in enumerate(ZS)), ";0"],
        "line 402 of .* has no position",
    ),
    "a lone column of positions": (
        ["x (um)", *(f"{z:.9f}" for z in Z)],
        {"step": STEP},
        r"is clear, with .\(um\)",
    ),
    "the heights alone of a raster that lacks its first one": (
        [f"{x},{y},{z if (x, y) != (XS[0], 0) else 'nan'}" for y in range(3) for x, z in PAIRS],
        {"columns": [3], **Z_UM},
        "line 401: it is a raster of 3 lines of 400 points, of which row K takes one",
    ),
    "another row": (["\t".join(ZS)] * 3, {"row": 3}, "row is 3: .* has the rows 0 to 2"),
    "a map": (["\t".join(ZS)] * 3, "has 400 columns: give columns X,Z, .* or row K, a row"),
    "a count for positions": (
        ["No.,Height (um)", *(f"{k},{z}" for k, z in enumerate(ZS, 1))],
        {"unit": "um"},
        "the first column of .* counts the points: give step",
    ),
    "a named count that begins anew": (
        ["Nr.;Höhe (um)", *(f"{k % 150};{z}" for k, z in enumerate(ZS))],
        {"step": STEP},
        r"does not count 1, 2, 3 .*: give columns Z, that of the heights, and step",
    ),
    "a count without a name, with gaps": (
        ['"","z"', *(f'"{k:.1f}",{z}' for k, z in enumerate(ZS) if k not in (7, 50, 51))],
        {"unit": "um"},
        "the first column of .* may count the points: give step",
    ),
    "rounded positions without a unit beside their step": (
        ["Step: 1.08 um", "x,z", *(f"{1.08 * k:.0f},{z}" for k, z in enumerate(ZS))],
        {"unit": "um"},
        "may be one that counts the points, and does not count 1, 2, 3 .*: give columns Z, that",
    ),
    "a unit of positions beside another step in the header": (
        ["dx = 0.5 um", "x;z", *(f"{k};{z}" for k, z in enumerate(ZS))],
        {"unit": "um,um"},
        "the positions of .* are 1 µm apart by unit, and 500 nm by its header: if the first column",
    ),
    "a factor above positions": (
        ["1.0e-03 *", *(f"{k}.5 {z}" for k, z in enumerate(ZS))],
        {"unit": "um"},
        r"line 1 .* is '1.0e-03 \*': multiply the numbers",
    ),
    "whole numbers and decimal commas": (
        ["x (nm),z (um)", *(f"{500 * k},{z.replace('.', ',')}" for k, z in enumerate(ZS))],
        r"give decimal \. if they are delimiters, or save it with semicolons",
    ),
    "two decimal signs": (
        ["x (um);z (um)", *(f"{x};{z.replace('.', ',')}" for x, z in PAIRS)],
        "line 2 .* write all numbers with one decimal sign",
    ),
    **{
        f"no metres: {head}": (
            [head, *(f"{1e-5 * k:.5f};{1e-5 * float(z):.9f}" for k, z in enumerate(ZS))],
            rf"no unit that is clear, with '{re.escape(shown)}' in its header",
        )
        for head, shown in {
            "x (?m);z (?m)": "(?m)", "X (1e-3 m);Z (1e-3 m)": "X (1e-3 m)", "X in;Z in": "X in",
            "[cm],[m];": "[cm],[m]",
            **{line: line for line in (
                "Units: feet", "All data in mm", "exported in mm by Surf 2.1",
                "x inch Depth meter OK",
            )},
        }.items()
    },
    "rows that go on": (
        [" ".join(ZS[k : k + 10]) for k in range(0, N, 10)],
        Z_UM,
        "has 10 columns: .*; heights that go on from row to row are to be written in one column",
    ),
    "numbers of rows of R without a step": (
        ['"z"', *(f'"{k}" {z}' for k, z in enumerate(ZS, 1))],
        {"unit": "um"},
        "the first column of .* may count the points: give step",
    ),
    "names by number": (["0,1", *TWO[1:]], {"unit": "um"}, "line 1 of .* has '1', .* it is a name"),
    "a name by number": (["0", *ZS], Z_UM, "line 1 of .* has '0', at the end .* if it is a name"),
    "columns in another order": (
        ["z (um);x (um)", *(f"{z};{x}" for x, z in PAIRS)],
        "if the numbers are positions and heights, in this order",
    ),
    "commas of thousands beside commas and blanks": (
        ["x, z, flag", *(f"{x}, {2000 + k:,}, 0" for k, x in enumerate(XS))],
        {"unit": "um,nm", "columns": [1, 2]},
        r"give decimal \. if they are delimiters, or save it with semicolons",
    ),
    "a unit and a comma": (TWO, {"unit": "um,"}, "unit is '': it must be one of m, cm, mm"),
    "a count of unknown name": (
        ["番号,高さ(um)", *(f"{k},{z}" for k, z in enumerate(ZS, 1))],
        "heights alone: give unit X,Z, .*, or step if the first column counts the points",
    ),
    "figures below heights": (["z (um)", *ZS, "", *ZS[:2]], Z_UM, "1 place, .* 402: write NaN"),
    "an empty line between": ([*ZS, "", *ZS[::-1]], Z_UM, APART),
    "two of them": ([*ZS, "", "", *ZS[::-1]], Z_UM, APART),
    "three columns": ([*ZS, "", *ZS[::-1], "", *ZS], Z_UM, APART),
    "equal parts between dashes": (
        [*ZS[:99], "--", *ZS[:99], "--", *ZS[:99]],
        Z_UM,
        "line 100 .* which may divide two profiles: write NaN if a height",
    ),
    "blocks divided by dashes": (["z (um)", *ZS, "-----", *ZS], Z_UM, "line 402 .* may divide"),
    "a count below two columns": ([UM, *TWO, "400"], "line 402 .* has '400', at the end"),
    "a last height cut off": ([UM, *TWO[:-1], TWO[-1][:-1]], "line 401 .* or was cut off"),
    "a last exponent cut off": (
        ["x [m] z [m]", *(f"{5e-7 * k:.3e} {z:.9e}" for k, z in enumerate(Z)), "2.000e-04 5.1e-0"],
        r"line 402 .* has '5\.1e-0', .* or was cut off",
    ),
    "header against option": ([UM, *TWO], {"unit": "mm"}, "unit is mm for the pos"),
    "a row of no map": ([UM, *TWO], {"row": 3}, "row is 3: .* is no map, as"),
    "two rows": ([UM, *TWO[:2]], "holds 2 rows of numbers"),
    "too few rows": ([UM, *TWO[:9]], "holds 9 rows of numbers: at least 32"),
    "time stamps": ([f"{10**17 + k} {z}" for k, z in enumerate(ZS)], {"unit": "nm"}, "stand still"),
    "twice the same place": ([UM, TWO[0], *TWO], "positions stand still at line 3"),
    "an unknown unit": (TWO, {"unit": "furlong"}, "unit is 'furlong': it must be one of m"),
    "heights in mm, positions in µm": (TWO, {"unit": "um,mm"}, "in the same unit"),
    "turning back": ([*TWO[:60], "25.0,0.1", *TWO[60:]], {"unit": "um"}, "turn back at line 61"),
    "unequal steps": (
        [f"{k**1.5:.4f} {z}" for k, z in enumerate(ZS)],
        {"unit": "um"},
        "steps of the positions are unequal",
    ),
    "no position": ([UM, *TWO[:9], ",1.0", *TWO[9:]], "line 11.*no position"),
    "a map with positions": (
        [",".join(["", *XS]), *(",".join([str(k), *ZS]) for k in range(3))],
        {"row": 1, "step": STEP, "unit": "um"},
        "the first row of .* rises or falls throughout, as positions do",
    ),
    "a map with a column of positions": (
        [",".join([f"{-k / 3:.2f}", *ZS[k:], *ZS[:k]]) for k in range(9)],
        {"row": 1, "step": STEP, "unit": "um"},
        "the first column of .* rises or falls throughout, as positions do",
    ),
    "a raster of short lines": (
        [f"{k // 5 / 2},{k % 5},{z}" for k, z in enumerate(ZS)],
        {"columns": [3], **Z_UM},
        "it is a raster of 80 lines of 5 points",
    ),
    "a raster whose positions are the slow ones": (
        [f"{k // 3},{k % 3},{z}" for k, z in enumerate(ZS[:399])],
        {"columns": [1, 3], "unit": "um"},
        "it is a raster of 133 lines of 3 points",
    ),
    "one column twice": ([UM, *TWO], {"columns": [1, 1]}, "columns is 1,1: it must name two of"),
    "a delimiter of two signs": ([UM, *TWO], {"delimiter": ";;"}, "it must be one of semicolons"),
    "a comma as both": ([UM, *TWO], {"delimiter": ",", "decimal": ","}, "the decimal sign: omit"),
    "decimal commas that are delimiters": (
        ["x (um),z (um)", *(f"{k},{k % 7}" for k in range(99))],
        {"decimal": ",", "unit": "um", "step": STEP},
        "commas can be .*: leave out decimal",
    ),
    "decimal commas between commas": (
        [f"{x},{z}".replace(".", ",") for x, z in PAIRS],
        {"decimal": ",", "unit": "um"},
        "commas can be .*: leave out decimal, or save it with semicolons",
    ),
    "no delimiter": ([UM, *TWO], {"delimiter": ""}, "delimiter is '': it must be one of"),
    "a wrong decimal sign": ([UM, *TWO], {"decimal": "x"}, "'x': it must be one of '.', ','"),
    "a column of words": ([f"{row},up" for row in TWO], "line 1 .* 'up', which is no number"),
    "thousands with a given form": (
        [f"{500 * k:,};{z}" for k, z in enumerate(ZS)],
        {"decimal": ".", "delimiter": ";"},
        "line 3 .* has '1,000', which is no number with a decimal point",
    ),
    "quoted rows": ([f'"{row}"' for row in TWO], "line 1 .* '0.000,.*quotes about rows out"),
    "SDF cut off": (["aISO-1.0", *SDF[:40]], "begins as an instrument's file, .* cut off"),
    "rounded positions, and a row left out": (
        [UM, *(f"{1.08 * k:.0f},{z}" for k, z in enumerate(ZS) if k != 200)],
        "whole multiples of 1 µm, 33 of them two apart: they may be rounded, or rows are left out",
    ),
    "positions rounded beyond use": (
        [f"{0.137 * k:.0f},{z}" for k, z in enumerate(ZS[:40])],
        {"unit": "um"},
        "which leaves their distance open between .*: give columns Z",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_what_may_be_something_else_is_refused_by_name(kind: str, tmp_path: Path) -> None:
    text, *options, words = REFUSED[kind]
    with pytest.raises(InputError, match=words) as refusal:
        read_trace(put(tmp_path / "t.txt", text), **dict(*options))
    assert "\n" not in str(refusal.value)
    assert "begin it with #" not in str(refusal.value)


# Names of which it is not known that the numbers are heights in the unit: nobody has to know them.
NOT_HEIGHTS = """\
log z (nm)|ln(z) (nm)|sqrt z (nm)|z² (nm)|z^2 (nm)|z** 2 (nm)|1000 z (nm)|1e3 z (nm)
z*1000 (nm)|z × 10 (nm)|z/10 (nm)|z:10 (nm)|-z (nm)|z (k nm)|z (knm)|z (10 nm)
z (x10 nm)|z (10^-9 m)|z (nm)/10|z [nm × 10]|z (nm) x 10|10 z / nm|z in 10 nm
z in 1/nm|z 1/µm|z 0.1 um|Height x / um|z per nm
z (nm per div)|z (um, nm)|(z nm)^2|½ z (nm)|z' (nm)|dz/dx (nm)|dz (nm)|Δz (nm)
slope (nm)|z error (nm)|std z (nm)|mean z (nm)|Ra (nm)|width (nm)|PSD (nm)|Current (A)
I (A)|A [A]|Strom (A)|電流(A)|Time (um)|wavelength (nm)|inverted z (nm)|abs(z) (nm)|x (nm)
Amplitude Error(nm)|height difference (nm)|log 높이 (nm)|1/z (nm)|z+offset (nm)|z nm (mm)"""
OTHER_UNITS = "V|mV|µV|A|nA|s|ms|deg|°|rad|counts|a.u.|N|Hz|px|%|nm²|nm^2|1/nm|nm/V|V/nm|LSB"


FEW = ROWS[:40]  # what is refused for its header needs no more


@pytest.mark.parametrize("name", re.split(r"[|\n]", NOT_HEIGHTS.strip()))
def test_a_unit_counts_behind_known_names_of_heights_alone(name: str, tmp_path: Path) -> None:
    for head, rows, *options in (
        (f"x (um);{name}", FEW),
        (f"X;{name}\n[um];[um]", FEW),
        (name, ZS[:40], {"step": STEP}),
    ):
        with pytest.raises(InputError, match=r"states (no|the) unit|is no length|above the num"):
            read_trace(put(tmp_path / "t.txt", [head, *rows]), **dict(*options))


@pytest.mark.parametrize("unit", OTHER_UNITS.split("|"))
def test_a_unit_by_option_makes_no_lengths_of_other_quantities(unit, tmp_path):
    for head, rows, *options in (
        (f"x (um);z ({unit})", FEW),
        (f"x [{unit}];z [um]", FEW),
        (f"x;z\num;{unit}", FEW),
        (f"z ({unit})", ZS[:40], {"step": STEP}),
    ):
        with pytest.raises(InputError, match=r"is no length|count|correct the wrong"):
            read_trace(put(tmp_path / "t.txt", [head, *rows]), unit="um", **dict(*options))


@pytest.mark.parametrize("name", ["番号", "Messpunkt", "Data point", "Pixel", "Frame", "t", "Time"])
def test_a_count_does_not_become_positions_by_the_unit_of_the_heights(name, tmp_path):
    path = put(tmp_path / "t.txt", [f"{name};z", *(f"{k};{z}" for k, z in enumerate(ZS, 1))])
    with pytest.raises(InputError, match=r"count.*: give step, as in 0\.5um"):
        read_trace(path, unit="um")
    assert read_trace(path, unit="um", step=STEP).step == STEP


def test_another_step_than_that_in_use_is_noted(tmp_path: Path) -> None:
    counted = ["Pitch: 0.5 um", "n;z (um)", *(f"{k};{z}" for k, z in enumerate(ZS))]
    of_stage = ["x (um),y (um),z (um)", *(f"{k / 2},{3 * k / 8},{z}" for k, z in enumerate(ZS))]
    for text, *options, note in (
        (counted, "the header has a step or pitch of 500 nm, against a step of 1 µm"),
        (counted[2:], {"unit": "um", "step": None}, "the first column is taken as positions: give"),
        ([UM, *TWO], {"columns": [2]}, "column 1 (x (um)) has steps of 0.5, as positions or a c"),
        (of_stage, {"columns": [1, 3], "step": None}, "column 2 (y (um)) has steps of 0.375, as"),
    ):
        notes = read_trace(put(tmp_path / "t.txt", text), **{"step": 1e-6} | dict(*options)).notes
        assert any(found.startswith(note) for found in notes)


def test_a_depth_is_noted_and_an_angstrom_read(tmp_path: Path) -> None:
    notes = read_trace(put(tmp_path / "t.txt", ["x (um);Depth (um)", *ROWS])).notes
    assert "their column is named 'Depth (um)': give invert if they grow into the sample" in notes
    rows = [f"{x};{1e4 * float(z):.2f}" for x, z in PAIRS]
    trace = read_trace(put(tmp_path / "t.txt", ["X [um];Z [A]", *rows]))
    np.testing.assert_allclose(trace.heights, Z, rtol=0, atol=1e-12)


def test_metres_that_are_assumed_are_a_doubt(tmp_path: Path) -> None:
    rows = [f"{5e-7 * k:.7f};{z:.12f}" for k, z in enumerate(Z)]
    for head, options, is_assumed in (
        ("X;Z", {}, True),
        ("X;Z", {"unit": "m"}, False),
        ("X (m);Z (m)", {}, False),
    ):
        trace = read_trace(put(tmp_path / "t.txt", [head, *rows]), **options)
        doubts = [f"no unit is given for the numbers of {tmp_path / 't.txt'}, so they are taken "
                  "as metres: give unit m if they are, or else their unit"]  # fmt: skip
        assert list(trace.warnings) == (doubts if is_assumed else [])
        assert prepare_trace(trace).warnings == trace.warnings
        assert any("(assumed: no unit is given)" in note for note in trace.notes) == is_assumed


@pytest.mark.parametrize("gap", ["---", "-", ""])
def test_the_shorter_one_of_two_traces_ends_where_it_does(gap: str, tmp_path: Path) -> None:
    rows = [
        f"{gap};{gap};{x};{z}" if k >= 300 else f"{x};{z};{x};{z}" for k, (x, z) in enumerate(PAIRS)
    ]
    path = put(tmp_path / "t.csv", ["A (um);B (um);C (um);D (um)", *rows])
    for columns, points in ([1, 2], 300), ([3, 4], 400):
        trace = read_trace(path, columns=columns)
        assert (trace.points, trace.drop_outs) == (points, 0)
        np.testing.assert_allclose(trace.heights, Z[:points], rtol=0, atol=1e-15)


@pytest.mark.parametrize("first", [["400"], ["0.500"], ["199.5", "400"], ["0"]])
def test_heights_of_a_period_do_not_begin_with_a_count_or_a_length(first, tmp_path):
    with pytest.raises(InputError, match=r"line 1 of .*, at the end of a column: remove it"):
        read_heights(put(tmp_path / "h.csv", [*first, *ZS]), unit="um")
    others = ZS[int(np.argmin(np.abs(Z))) :]  # which begin near nought
    heights, _ = read_heights(put(tmp_path / "h.csv", ["0", *others]), unit="um")
    assert len(heights) == len(others) + 1


NAMED = [
    "Scan step: 0.5 um", "X-Pitch (um)\t0.5", "Spacing,0.5,um", "Data spacing 0.5 um", "dx=0.5um",
    "Sampling interval=0.5um", "Delta X: 0.5 um", "X Step: 500 nm", "Step size: 0.5 µm/pt",
    "StepSize=0.5um", "Pitch X;0.5;[um]", "dx_um = 0.5", "Step in um: 0.5",
    "Sample spacing: 5e-7 m", "points: 400; step: 0.5 um", "Punktabstand [µm]: 0.5",
    "Pixel size: 0.5 um", "Step: .5 um", "Spacing 0.0005 mm", "Messschrittweite 0.5 µm",
    "Pas d'échantillonnage : 0.5 µm", "測定ピッチ, 0.5 µm", "측정 간격: 0.5 µm",
]  # fmt: skip
OTHERS = [
    "Traverse length: 5.6 mm", "Groove spacing: 3 um", "Mean spacing of profile elements: 21 um",
    "Spacing (mean): 21 um", "Pitch of thread: 3 mm", "Line pitch: 5 um", "Y step: 5 um",
    "Z step: 1 nm", "Sm spacing 20 um", "Step (height): 98 nm", "Sampling: 0.8 mm", "dy = 5 um",
    "Interval between lines: 5 um", "Pitch in Y: 5 um", "Step width: 8 um", "Step: 0.5 um/s",
    "Sampling rate: 500 nm", "Step 2 of 3: 0.5 mm", "Vertical increment: 1 nm", "Steps: 400",
    "Spacing parameter S: 4 um", "Average pitch: 3 um", "Interval: 5 s", "Sampling length 0.8 mm",
    "Spacing (points/um): 2", "Step: ~0.4 um", "X scale: 200 um", "Pitch: 0.5 um", "Pas: 0.5 um",
    "ピッチ: 0.5 um", "Pitch of grating: 0.5 um", "dx: 5000 A", "2 dx: 0.5 um", "Period: 0.5 um",
]  # fmt: skip


@pytest.mark.parametrize("line", [*NAMED, *OTHERS])
def test_only_the_distance_of_two_points_is_a_step(line: str) -> None:
    found = step_of_header("t.txt", ["Profile", line], ".")
    assert found == (pytest.approx(STEP, rel=1e-12) if line in NAMED else None)
