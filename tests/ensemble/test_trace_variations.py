"""Two hundred texts drawn by a seed: each is read as it was written, or refused in one sentence.

A text is written from heights, a step and units that are known: with any encoding, delimiter,
quotes, blanks, codes for missing heights, lengths of other meanings in the header, order of its
lines, columns beside, and rounding of the positions. Nothing else may come back with exit code 0.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from adhesis.ensemble.errors import InputError
from adhesis.ensemble.trace.reading.measured_trace import Trace, read_trace
from adhesis.solver.model.profile import Array

VARIATIONS = 200
SIZES = {"mm": 1e-3, "µm": 1e-6, "nm": 1e-9, "mil": 25.4e-6, "µin": 25.4e-9}
SPELLED = {
    "mm": ["mm", "㎜", "millimeters"],
    "µm": ["um", "µm", "μm", "㎛", "micron"],
    "nm": ["nm", "㎚", "nanometers"],
    "mil": ["mil", "mils"],
    "µin": ["uin", "µin", "microinch"],
}
# Lengths in a header that are not the distance of two points.
OTHER_LENGTHS = [
    "Sampling length: 0.8 mm", "Step height: 98.5 nm", "RSm (mean spacing): 21.4 um",
    "Cut-off (mm): 0.8", "Evaluation length = 4 mm", "Pitch Y: 5 um", "Tip radius 2 µm",
    "Line spacing: 7 um", "Scan length, mm;0.0995", "Measuring speed: 0.5 mm/s",
    "Date: 2024-03-01 10:30", "Operator: K. Müller", "Ra = 0.12 um", "Groove pitch: 3 µm",
]  # fmt: skip
STEPS = ["Step: {}", "Spacing = {}", "Measuring pitch: {}", "dx: {}", "Pitch X: {}", "Δx = {}"]
CODES: list[list[str]] = [
    ["NaN"], ["---"], ["-9999"], ["99.99", "-99.99"], ["-99999.9999", "-99999.9998"],
    ["-32768", "32767"], ["1e38"],
]  # fmt: skip
ENCODINGS = [
    "utf-8", "utf-8-sig", "utf-16", "latin-1", "cp949", "gbk", "shift_jis", "cp1251",
]  # fmt: skip
NAMES = {"cp949": ("위치", "높이"), "gbk": ("位置", "高度"), "shift_jis": ("位置", "高さ")}


@dataclass
class Text:
    """A text, and what is in it."""

    data: bytes
    step: float
    heights: Array
    options: dict[str, object]
    is_whole: bool  # and nothing besides: it has to be read


def draw_text(seed: int) -> Text:
    draw = random.Random(seed)
    n = draw.randint(60, 160)
    step = draw.choice([0.5e-6, 0.156e-6, 1.08e-6, 2e-6, 0.25e-6])
    k = np.arange(n)
    rng = np.random.default_rng(seed)
    heights = 2e-7 * (np.sin(k / 7) + 0.3 * np.sin(k / 1.7 + 1) + 0.05 * rng.standard_normal(n))
    x_unit, z_unit = draw.choice(["mm", "µm", "mil"]), draw.choice(["µm", "nm", "µin"])
    encoding = draw.choice([*ENCODINGS, "utf-8", "utf-8"])
    decimal = draw.choice([".", ".", ","])
    delimiter = draw.choice([";", "\t", " ", "|", *([","] if decimal == "." else [])])
    quotes = draw.choice([None, None, "all", "first"]) if delimiter != " " else None
    blanks = draw.choice([None, None, None, "each row", "two", "tail", "middle", "crcrlf"])
    kind = draw.choice(["two", "two", "one", "index", "three", "empty", "valid"])
    has_units = draw.random() < 0.8
    # Two decimals more than the numbers need, and seven of the positions at least.
    decimals = {"mm": 7, "µm": 4, "mil": 6}[x_unit]
    is_rounded = kind in ("two", "three") and draw.random() < 0.15 and n >= 100
    if is_rounded:
        decimals, x_unit = (1 if step < 1e-6 else 0), "µm"
    places = {"µm": 6, "nm": 3, "µin": 4}[z_unit]
    xs = [f"{step * i / SIZES[x_unit]:.{decimals}f}" for i in range(n)]
    zs = [f"{h / SIZES[z_unit]:.{places}f}" for h in heights]
    heights = np.array([float(z) for z in zs]) * SIZES[z_unit]

    if draw.random() < 0.4:
        codes = draw.choice(CODES)
        for code in codes:
            start = draw.randint(5, n - 10)
            for i in range(start, start + draw.randint(3, 4)):
                zs[i], heights[i] = code, np.nan
    valid = ["1"] * n
    if kind == "valid":
        for i in range(20, 24):
            valid[i], heights[i] = "0", np.nan
    if draw.random() < 0.1:
        zs = [z.replace("-", "−") for z in zs]
        encoding = "utf-8"

    def in_signs(text: str) -> str:
        return text.replace(".", decimal)

    columns = {
        "two": [xs, zs],
        "one": [zs],
        "index": [[str(i + 1) for i in range(n)], zs],
        "three": [[str(7 * i) for i in range(n)], xs, zs],
        "empty": [xs, zs, [""] * n, [""] * n],
        "valid": [xs, zs, valid],
    }[kind]
    rows = [[in_signs(cell) for cell in row] for row in zip(*columns, strict=True)]
    if quotes is not None:
        rows = [
            [f'"{cell}"' if quotes == "all" or place == 0 else cell for place, cell in enumerate(r)]
            for r in rows
        ]
    lines = [delimiter.join(row) for row in rows]

    x_name, z_name = NAMES.get(encoding, ("x", "z"))
    form = draw.choice(["{} ({})", "{} [{}]", "{}1 ({})"])
    spelled = [
        draw.choice([s for s in SPELLED[unit] if s.isascii() or encoding.startswith("utf")])
        for unit in (x_unit, z_unit)
    ]
    names = [form.format(x_name, spelled[0]), form.format(z_name, spelled[1])]
    if not has_units:
        names = [x_name, z_name]
    named = {
        "two": names,
        "one": names[1:],
        "index": ["No.", names[1]],
        "three": ["t", *names],
        "empty": [*names, ""],
        "valid": [*names, "valid"],
    }[kind]
    head = draw.sample(OTHER_LENGTHS, draw.randint(0, 4))
    options: dict[str, object] = {}
    if kind in ("one", "index"):
        if draw.random() < 0.6:
            written = in_signs(f"{step * 1e6:g}") + " um"
            head.append(draw.choice(STEPS).format(written))
        else:
            options["step"] = step
    draw.shuffle(head)
    if not has_units:
        options["unit"] = z_unit if kind in ("one", "index") else f"{x_unit},{z_unit}"
    if kind in ("three", "valid"):
        options["columns"] = (2, 3) if kind == "three" else (1, 2)
    # A single name between spaces or bars has no field of its own to stand in.
    head.append(("  " if delimiter == " " else delimiter).join(named))
    if decimal == "," and kind in ("one", "index") and delimiter == " ":
        options["decimal"] = ","

    empty = delimiter * (len(columns) - 1) if delimiter != " " else ""
    if blanks == "each row":
        lines = [part for line in lines for part in (line, "")]
    elif blanks == "two" and kind != "one":
        lines = [part for i, line in enumerate(lines) for part in (line, *[""] * (i % 2))]
    elif blanks == "tail":
        lines += [empty] * 5
    elif blanks == "middle" and kind != "one":
        lines[30:30] = [empty] * 2
    ends = draw.choice(["nothing", "words", "words", "block", "checksum"])
    if ends == "words":
        lines += ["", "End of file"]
    elif ends == "block":
        lines += ["# second profile", *lines]
    elif ends == "checksum":
        lines += ["34582"]
    is_whole = ends in ("nothing", "words")
    if kind == "one" and draw.random() < 0.3:
        is_whole = False
        first = draw.choice([str(n), f"{step * 1e6:g}", f"{n * step * 1e6:g}", f"{step * 1e3:g}"])
        lines.insert(0, in_signs(first))
    end = "\r\r\n" if blanks == "crcrlf" else draw.choice(["\n", "\r\n", "\r"])
    data = end.join([*head, *lines, ""]).encode(encoding, errors="replace")
    is_whole &= encoding.startswith("utf") or (encoding == "latin-1" and b"?" not in data)
    return Text(data, step, heights, options, is_whole)


def problem_of(text: Text, trace: Trace) -> str | None:
    """Return how a trace differs from what was written, or None."""
    if trace.points != text.heights.size:
        # Missing heights at an end may be left out, nothing else.
        return f"{trace.points} points of {text.heights.size}"
    if abs(trace.step / text.step - 1) > 3e-3:
        return f"step {trace.step}, not {text.step}"
    gaps = np.isnan(trace.heights)
    if not np.array_equal(gaps, np.isnan(text.heights)):
        return f"{gaps.sum()} drop-outs, not {np.isnan(text.heights).sum()}"
    if not np.allclose(trace.heights[~gaps], text.heights[~gaps], rtol=1e-9, atol=1e-16):
        return "other heights"
    return None


def outcome(seed: int, folder: Path) -> tuple[str, str | None]:
    """Return the sentence with which a text is refused, if it is, and what is wrong with that."""
    text = draw_text(seed)
    path = folder / f"{seed}.txt"
    path.write_bytes(text.data)
    try:
        trace = read_trace(path, **text.options)  # type: ignore[arg-type]
    except InputError as refusal:
        sentence = str(refusal)
        return sentence, f"{seed}: {sentence}" if text.is_whole or "\n" in sentence else None
    wrong = problem_of(text, trace)
    return "", f"{seed}: {wrong}; {trace.notes}" if wrong else None


def test_no_variation_is_read_as_another_trace_and_all_whole_ones_are_read(tmp_path: Path) -> None:
    """Whole is what neither ends with another block or a checksum nor begins with a count.

    Names, units and steps in other encodings than UTF and Latin-1 need not be understood.
    """
    found = [outcome(seed, tmp_path) for seed in range(VARIATIONS)]
    assert [wrong for _, wrong in found if wrong] == []
    assert sum(not refusal for refusal, _ in found) > 0.4 * VARIATIONS
