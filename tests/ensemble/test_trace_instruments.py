"""Instrument files: the right heights from each format that the extra reads, or one sentence."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

import adhesis.ensemble.trace.reading.instrument as instrument
import adhesis.ensemble.trace.reading.measured_trace as read
from adhesis.ensemble.command.main import main
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.trace.reading.measured_trace import read_trace
from tests.support import instrument_files

pytestmark = pytest.mark.skipif(
    not instrument.available(), reason="the optional package SurfaceTopography is not installed"
)

N, STEP = 150, 0.4e-6
X = STEP * np.arange(N)
Z = 2e-7 * np.sin(2 * np.pi * X / 17e-6) + 3e-8 * np.cos(2 * np.pi * X / 2.9e-6)


@pytest.mark.parametrize("name", instrument_files.WRITERS)
def test_every_format_gives_the_same_heights(name: str, tmp_path: Path) -> None:
    """The step above all: the formats count points or steps, from nought or from one."""
    path = tmp_path / name
    instrument_files.WRITERS[name](path, STEP, Z)
    trace = read_trace(path)
    assert trace.points == N
    assert trace.step == pytest.approx(STEP, rel=1e-6)
    np.testing.assert_allclose(trace.heights, Z, atol=1e-10)
    assert trace.notes
    with path.open("rb") as stream:
        again = read_trace(stream)
    assert again == trace


@pytest.mark.parametrize(
    ("name", "missing"),
    [
        *((name, np.nan) for name in ("mahr.qep", "row.x3p", "row.sdf", "row.sur")),
        ("row.sdf", 1e38),
    ],
)
def test_points_not_measured_are_drop_outs(name: str, missing: float, tmp_path: Path) -> None:
    heights = Z.copy()
    heights[[40, 41]] = missing
    instrument_files.WRITERS[name](tmp_path / name, STEP, heights)
    trace = read_trace(tmp_path / name)
    assert np.flatnonzero(np.isnan(trace.heights)).tolist() == [40, 41]


def test_the_tip_radius_of_the_file_is_known(tmp_path: Path) -> None:
    instrument_files.mahr(tmp_path / "a.qep", STEP, Z, tip_radius=5e-6)
    assert read_trace(tmp_path / "a.qep").tip_radius == pytest.approx(5e-6)


def test_a_map_needs_a_row(tmp_path: Path) -> None:
    path = tmp_path / "map.sdf"
    instrument_files.sdf(path, STEP, Z, rows=4)
    with pytest.raises(InputError, match=r"150 × 4 heights: row K takes one .* 0 to 3"):
        read_trace(path)
    np.testing.assert_allclose(read_trace(path, row=3).heights, Z, atol=1e-12)
    with pytest.raises(InputError, match="has the rows 0 to 3"):
        read_trace(path, row=4)
    with pytest.raises(InputError, match="channel is 2"):
        read_trace(path, row=0, channel=2)


@pytest.mark.parametrize("name", instrument_files.WRITERS)
def test_half_a_file_is_one_sentence_and_code_2(name, tmp_path, capsys):
    path = tmp_path / name
    instrument_files.WRITERS[name](path, STEP, Z)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    words = ["--work-of-adhesion", "0.04", "--young", "1e6", "--poisson", "0.5", "--plan"]
    assert main(["trace", str(path), *words]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize("option", [{"unit": "um"}, {"step": STEP}, {"columns": (1, 2)}])
def test_units_of_texts_do_not_belong_to_instruments(option, tmp_path):
    instrument_files.mahr(tmp_path / "a.qep", STEP, Z)
    with pytest.raises(InputError, match=f"{next(iter(option))} belongs to texts"):
        read_trace(tmp_path / "a.qep", **option)


def test_without_the_extra_it_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    instrument_files.mahr(tmp_path / "a.qep", STEP, Z)
    monkeypatch.setattr(read, "available", lambda: False)
    with pytest.raises(InputError, match=r"python.* -m pip install 'SurfaceTopography>=1.27'"):
        read_trace(tmp_path / "a.qep")


def wsxm(path: Path, comments: int) -> Path:
    """A map of WSxM, 64 × 48 heights in nm: a header in words, and numbers of eight bytes."""
    heights = np.add.outer(np.arange(48.0), 10 * np.sin(np.arange(64) / 5))
    words = [
        "WSxM file copyright Nanotec Electronica", "SxM Image file", "Image header size: 0", "",
        "[Control]", "", "    X Amplitude: 3 um", "    Y Amplitude: 2 um", "", "[General Info]", "",
        "    Image Data Type: double", "    Number of columns: 64", "    Number of rows: 48",
        f"    Z Amplitude: {np.ptp(heights)} nm", "", "[Miscellaneous]", "",
        *(f"    Comments {k:02d}: a sample on a stage" for k in range(comments)),
        f"    Maximum: {heights.max()}", f"    Minimum: {heights.min()}", "", "[Header end]", "",
    ]  # fmt: skip
    path.write_bytes("\r\n".join(words).encode() + heights.astype("<f8").tobytes())
    return path


@pytest.mark.parametrize("name", ["a.stp", "a.dat", "a.txt", "a.csv", "a.001", "a"])
@pytest.mark.parametrize("comments", [1, 400])
def test_a_file_of_an_instrument_is_known_by_its_content(name, comments, tmp_path):
    trace = read_trace(wsxm(tmp_path / name, comments), row=3)
    assert trace.points == 64
    assert trace.step == pytest.approx(3e-6 / 64)
    reference = read_trace(wsxm(tmp_path / "b.stp", 1), row=3)
    np.testing.assert_array_equal(trace.heights, reference.heights)


def test_heights_without_lengths_are_not_asked_of_the_reader(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["surface"] = np.outer(Z, Z)
    with pytest.raises(InputError, match=r"a\.h5 states no lengths or no .* give step and unit"):
        read_trace(tmp_path / "a.h5")


def test_a_file_of_no_reader_is_refused_in_one_sentence(tmp_path, caplog, capsys, monkeypatch):
    """One of the readers logs the bytes that it cannot use."""
    (tmp_path / "a.bin").write_bytes(bytes(range(256)) * 20)
    words = ["trace", str(tmp_path / "a.bin"), "--plan", "--work-of-adhesion", "0.01"]
    with monkeypatch.context() as alone:
        alone.setattr(logging.root, "handlers", [])  # as those of a command, which has set up none
        assert main([*words, "--young", "1e6", "--poisson", "0.5"]) == 2
    (sentence,) = capsys.readouterr().err.splitlines()
    assert sentence.startswith("adhesis trace: ")
    assert "is neither text nor an instrument format" in sentence
    with pytest.raises(InputError):
        read_trace(tmp_path / "a.bin")
    assert caplog.messages  # a program that has set up handlers of logs still gets them
