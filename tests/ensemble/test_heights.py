"""The heights of one period: read as traces are, and warned of where the ends do not meet."""

import gzip
import io
import json
import os
import zipfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import adhesis.ensemble.command.loop as loop_command
from adhesis.ensemble.campaign.file import load_campaign
from adhesis.ensemble.command.main import main
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.loop.heights import heights_warning, read_heights
from adhesis.ensemble.trace.reading.measured_trace import read_trace
from adhesis.solver.model.profile import Array, self_affine_profile, single_wave
from tests.support.campaign_support import campaign_text
from tests.support.options import OF_WAVE
from tests.support.options import WAVE_HEIGHTS as WAVE

SINGLE = single_wave(1e-9, 1e-3)

NM = [f"{1e9 * h:.6f}" for h in WAVE]
METRES = [repr(float(h)) for h in WAVE]
COMMAS = [h.replace(".", ",") for h in NM]

TEXTS: dict[str, tuple[str, bytes, dict[str, str]]] = {
    "metres": ("a.csv", "\n".join(METRES).encode(), {}),
    "a header without a unit": ("a.csv", "\n".join(["height", *METRES]).encode(), {}),
    "a comment": ("a.csv", "\n".join(["# one period (in m)", *METRES]).encode(), {}),
    "a header with a unit": ("a.csv", "\n".join(["z (nm)", *NM]).encode(), {}),
    "decimal commas": ("a.csv", "\n".join(["Höhe [nm]", *COMMAS]).encode(), {}),
    "UTF-32": ("a.csv", "\n".join(["Höhe [nm]", *COMMAS]).encode("utf-32"), {}),
    "a unit by option": ("a.csv", "\n".join(NM).encode(), {"unit": "nm"}),
    "one row": ("a.csv", ",".join(METRES).encode(), {}),
    "one row, spaces": ("a.csv", " ".join(METRES).encode(), {}),
    "one row, decimal commas": ("a.csv", ("z (nm)\n" + ";".join(COMMAS)).encode(), {}),
    "a long header": ("a.csv", "\n".join(["x" * 300_000, *METRES]).encode(), {}),
}


@pytest.mark.parametrize("kind", TEXTS)
def test_every_usual_text_gives_the_same_heights(kind: str, tmp_path: Path) -> None:
    name, data, options = TEXTS[kind]
    path = tmp_path / name
    path.write_bytes(data)
    np.testing.assert_allclose(read_heights(path, **options)[0], WAVE, rtol=0, atol=2e-15)


def test_an_array_is_read_in_metres_or_the_unit_given(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", 1e9 * WAVE[:, None])
    np.testing.assert_allclose(read_heights(tmp_path / "a.npy", unit="nm")[0], WAVE, rtol=1e-12)
    np.save(tmp_path / "b.npy", WAVE)
    assert np.array_equal(read_heights(tmp_path / "b.npy")[0], WAVE)


def test_pillars_and_ground_of_one_height_are_heights(tmp_path: Path) -> None:
    pillars = np.where(np.arange(64) % 16 < 3, 999.0, 100 * np.cos(np.arange(64)))
    np.save(tmp_path / "a.npy", pillars)
    heights, said = read_heights(tmp_path / "a.npy", unit="nm")
    assert np.array_equal(heights, 1e-9 * pillars)
    assert "12 heights of 999 may stand for missing ones" in said


def archive(name: str) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as file:
        file.writestr(name, "1")
    return stream.getvalue()


PNG = b"\x89PNG\r\n\x1a\n" + bytes(40)
# What neither --heights nor adhesis trace takes: name, content, sentence.
FOREIGN: dict[str, tuple[str, bytes, str]] = {
    "gzip": ("x.csv.gz", gzip.compress(b"1\n2\n3\n"), r"compressed \(gzip\): .* \(gunzip .*gz\)"),
    "bzip2": ("x.bz2", b"BZh91AY&SY", r"compressed \(bzip2\)"),
    "xz": ("x.xz", b"\xfd7zXZ\0\0", r"compressed \(xz\): unpack it first \(unxz"),
    "zip": ("x.zip", archive("x.csv"), r"is an archive \(zip\): unpack it first"),
    "xlsx": ("x.xlsx", archive("xl/workbook.xml"), r"is a workbook: save its columns as text"),
    "xls": ("x.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(99), "is a workbook"),
    "xlsx as csv": ("x.csv", archive("xl/workbook.xml"), "is a workbook: save its columns as text"),
    "zip as dat": ("x.dat", archive("x.csv"), r"is an archive \(zip\): unpack it first"),
    "npz": ("x.npz", archive("z.npy"), r"archive of arrays: save the one of the heights as \.npy"),
    "pdf": ("x.pdf", b"%PDF-1.7\n", "is a PDF: export the heights as text"),
    "png": ("x.png", PNG, r"is a picture \(PNG\)"),
    "jpeg": ("x.jpg", b"\xff\xd8\xff\xe0" + bytes(40), r"is a picture \(JPEG\)"),
    "empty": ("x.csv", b"", "is empty"),
    "blank": ("x.csv", b" \n\n", "is empty"),
    "binary": ("x.csv", bytes(range(256)) * 9, "neither text nor |no text, and unit belongs"),
    "zero bytes": ("x.csv", b"1\n2\n3\n" * 9000 + b"\0", "holds zero bytes"),
    "UTF-16 without a mark": ("x.csv", "1\n2\n3".encode("utf-16-le"), "zero bytes.*UTF-16 with"),
    "words": ("x.csv", b"a trace\nof words\n", "holds no line of numbers"),
    "one long line": ("x.csv", b"y" * 2_000_000, "holds no line of numbers"),
    "ambiguous and long": ("x.csv", b"1,2,3,4\n" + b"1" * 999 + b",2,3,4\n" * 9, r"give decimal"),
    "no array": ("x.npy", b"junk", "holds no line of numbers"),
    "half an array": ("x.npy", b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', '", r"is no \.npy"),
}


@pytest.mark.parametrize("read", [read_heights, read_trace, partial(read_trace, unit="um")])
@pytest.mark.parametrize("kind", FOREIGN)
def test_foreign_files_are_refused_in_one_short_sentence(kind, read, tmp_path):
    name, data, words = FOREIGN[kind]
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(InputError, match=words) as refusal:
        read(path)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 300 + len(str(path))


@pytest.mark.parametrize("read", [read_heights, read_trace], ids=["heights", "trace"])
def test_a_file_that_may_not_be_read_is_refused(read, tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_text("1")

    def refuse(path: Path, *_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied", str(path))  # root may read everything

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(InputError, match=r"cannot read .*a\.csv: Permission denied"):
        read(path)


OF_HEADER = """16 heights in m (header); they are named 'Depth (m)': change their sign if they \
grow into the sample; the header has a step or pitch of 9 µm, against a step of 62.5 µm"""
DOUBTFUL: dict[str, tuple[list[str], dict[str, Any], str]] = {
    "a unit that was damaged": (["z [æm]", *METRES], {}, r"is clear, with '\[æm\]' in .*give unit"),
    "line of the header against option": (
        ["Unit: µm", *NM],
        {"unit": "nm"},
        "unit is nm for the heights, and the hea",
    ),
    "one high asperity": (
        ["0.000"] * 400 + ["1.000"] * 2,
        {},
        "states no unit, and heights from 0 to 1 need not be metres",
    ),
    "steep ones": (
        [f"{1e-4 * (-1) ** k}" for k in range(99)],
        {"period": 1e-3},
        "need not be metres",
    ),
    "two units": (METRES, {"unit": "mm,um"}, "--unit is 'mm,um': with --heights it is one unit"),
    "positions": ([f"{k} {h}" for k, h in enumerate(METRES)], {}, "holds 16 × 2 numbers: --hei"),
    "nan": ([*METRES[:5], "nan", *METRES[5:]], {}, "has no finite height on line 6: --heights"),
    "overflow": ([*METRES[:5], "-1e400", *METRES[5:]], {}, "has no finite height on line 6"),
    "an empty line": ([*METRES[:5], "", *METRES[5:]], {}, "on line 6: .* in a file$"),
    "nan at the beginning": (["1", "nan", *METRES], {}, "has no finite height on line 2"),
    **{f"{gap} at the end": ([*METRES, gap], {}, "height on line 17") for gap in ("nan", '""')},
    "a code": (
        [*NM[:5], "-9999", *NM[5:]],
        {"unit": "nm"},
        "on line 6 .1 height of -9999, which instruments write for missing ones",
    ),
    "two codes": (
        [*NM[:5], "-32768", *NM[5:9], "32767", *NM[9:]],
        {"unit": "nm"},
        "line 6 .2 heights of -32768, 32767, which instruments write for missing ones",
    ),
}


@pytest.mark.parametrize(
    ("kind", "options", "said"),
    [
        ("z", (), "16 heights in m (assumed: no unit is given)"),
        ("z", ("--unit", "m"), "16 heights in m (--unit)"),
        ("dx = 9 um\nDepth (m)", (), OF_HEADER),
    ],
)
def test_how_heights_were_read_stands_beside_the_loss(kind, options, said, tmp_path, capsys):
    path = tmp_path / "a.csv"
    path.write_text("\n".join([kind, *METRES]))
    words = ["loop", "--heights", path, *OF_WAVE, "--load-steps", 2, "--quiet", *options]
    assert main([*map(str, words), "--json", str(tmp_path / "o.json")]) == 0
    assert f"read        {path}: {said}\n" in capsys.readouterr().out
    assert json.loads((tmp_path / "o.json").read_text())["read"] == {"said": [said]}


@pytest.mark.parametrize("kind", DOUBTFUL)
def test_doubtful_heights_are_refused(kind: str, tmp_path: Path) -> None:
    lines, options, words = DOUBTFUL[kind]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match=words):
        read_heights(path, **options)


def rough(seed: int, n0: int) -> Array:
    """A self-affine profile of 801 points; of one period for n0 = 1, else a part of it."""
    profile = self_affine_profile(0.8, period=1e-3, n0=4, ratio=20, seed=seed, h_rms=1e-6)
    return profile.heights(800 * n0)[:800]


X = np.arange(200) / 200
PERIODIC: dict[str, Array] = {
    "self-affine": rough(1, 1),
    "sine": np.sin(2 * np.pi * X),
    "four points of a wave": np.array([0.0, 1.0, 0.0, -1.0]),
    "three points": np.array([0.0, 1.0, 2.0]),
    "five points": np.array([0.0, 1.0, 2.0, 3.0, 4.0]),
    "cylinders": -((X - 0.5) ** 2),
    "cylinders, from crest to crest": -(np.minimum(X, 1 - X) ** 2),
    "saw of one tooth": X,
    "saw of one tooth, from its middle": (X + 0.5) % 1,
    "saw of two teeth": (2 * X) % 1,
    "steps": (X < 0.5).astype(float),
    "a wave between its nodes": np.cos(2 * np.pi * (X + 1 / 400)),
    "a wave in whole steps": np.round(20 * np.sin(2 * np.pi * (X + 0.3 / 200))),
    "white noise": np.random.default_rng(0).standard_normal(300),
    "one spike": np.eye(50)[7],
    "flat": np.ones(20),
}
RNG = np.random.default_rng(3)
CUT: dict[str, Array] = {
    "tilted": rough(1, 1) + 20e-6 * X.repeat(4),
    "tilted and noisy": rough(1, 1) + 2e-5 * X.repeat(4) + 5e-9 * RNG.standard_normal(800),
    "part of a profile": rough(1, 4),
    "with a speck of dust": rough(1, 1) + 2e-5 * X.repeat(4) + 2e-5 * np.eye(800)[300],
}


@pytest.mark.parametrize("kind", PERIODIC)
def test_a_period_is_not_warned_of(kind: str) -> None:
    warning = heights_warning(PERIODIC[kind], "it")
    if len(PERIODIC[kind]) < 8:
        assert warning is not None
        assert "heights only" in warning
    else:
        assert warning is None


@pytest.mark.parametrize("kind", ["self-affine", "sine", "a wave between its nodes", "white noise"])
def test_an_end_that_repeats_the_beginning_is_warned_of(kind: str) -> None:
    heights = np.append(PERIODIC[kind], PERIODIC[kind][0])
    assert "the last height of it is its first one: if" in str(heights_warning(heights, "it"))


@pytest.mark.parametrize("kind", CUT)
def test_ends_that_do_not_meet_are_warned_of(kind: str) -> None:
    sentence = heights_warning(CUT[kind], "it.csv")
    assert sentence.startswith("the ends of it.csv do not meet: from its last height")
    assert "adhesis trace" in sentence


def test_no_shift_of_a_periodic_profile_is_warned_of() -> None:
    """The warning compares steps, so that it must not depend on where a period begins."""
    for seed in range(20):
        heights = rough(seed, 1)
        assert not any(heights_warning(np.roll(heights, k), "it") for k in range(0, 800, 37))


@pytest.mark.parametrize("path", [(), ("--path", "0.5,0.2,0.4,out")], ids=["loop", "path"])
def test_the_warning_goes_to_stderr_json_and_exit_code(path, tmp_path, monkeypatch, capsys):
    # The loop is of a single wave: only the heights that are read are tilted.
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(loop_command, "profile_from_heights", lambda heights, period: SINGLE)
    Path("a.csv").write_text("\n".join(repr(float(h)) for h in CUT["tilted"]))
    Path("b.csv").write_text("\n".join(METRES))
    words = (*OF_WAVE, "--load-steps", 2, "--json", "o.json", "--quiet", *path)

    def run(*more: object) -> tuple[int, str]:
        code = main(["loop", *map(str, (*words, *more))])
        return code, capsys.readouterr().err

    # The wave is so small that the zero-range limit is doubtful, which is another warning.
    code, reported = run("--heights", "a.csv")
    (sentence,) = (line for line in reported.splitlines() if "_range" not in line)
    assert code == 0
    assert sentence.startswith("adhesis loop: the ends of a.csv do not meet")
    data = json.loads(Path("o.json").read_text())
    assert sentence.removeprefix("adhesis loop: ") in data["warnings"]
    assert run("--heights", "a.csv", "--strict") == (1, reported)
    assert "do not meet" not in run("--heights", "b.csv")[1]
    warnings = json.loads(Path("o.json").read_text())["warnings"]
    assert not any("do not meet" in warning for warning in warnings)


def test_a_campaign_may_have_a_utf_8_mark(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_bytes(campaign_text().encode("utf-8-sig"))
    assert load_campaign(path).text == campaign_text()


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (campaign_text().encode("utf-16"), "it is not UTF-8 text (UTF-16), so save it as UTF-8"),
        (campaign_text().encode("utf-16-le"), "it is not UTF-8 text (it holds zero bytes), so"),
        (b"# a\n# \xe4\n", "it is not UTF-8 text (line 2 holds the byte 0xe4), so save it as"),
    ],
)
def test_a_campaign_in_another_encoding_is_refused(data, reason, tmp_path):
    path = tmp_path / "c.toml"
    path.write_bytes(data)
    with pytest.raises(InputError) as refusal:
        load_campaign(path)
    assert str(refusal.value).startswith(f"{path} is not a campaign file: {reason}")
