"""Saved loops and paths: what was saved is loaded, and nothing else, from whatever a file holds."""

import os
import random
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

import adhesis
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.loop.saved import sealed
from tests.support.crafted_hdf5 import made, put, virtual
from tests.support.exact_wave import ExactWave

SEAL = len(sealed(b""))
HALF_SPACE = adhesis.HalfSpace(1e6, 0.5)
PROBLEM = adhesis.Problem(adhesis.single_wave(1e-6, 1e-3), HALF_SPACE, 1e-4)


@pytest.fixture(scope="module")
def loop() -> adhesis.LoopResult:
    return adhesis.run_loop(ExactWave(PROBLEM), max_penetration=0.6, load_steps=6)


@pytest.fixture(scope="module")
def content(loop: adhesis.LoopResult, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("saved") / "loop.nc"
    loop.save(path)
    return path.read_bytes()


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as error:
        adhesis.load(path)
    sentence = str(error.value)
    assert sentence.startswith(f"path is {path}: ")
    assert "\n" not in sentence
    return sentence


def test_other_programs_open_a_saved_file(loop, content, tmp_path):
    path = tmp_path / "loop.nc"
    path.write_bytes(content)
    for engine in ("h5netcdf", None):
        with xr.open_dataset(path, engine=engine) as found:
            np.testing.assert_array_equal(found.mean_stress, loop.mean_stress)
            assert found.mean_stress.units == "Pa"
            assert found.attrs["loss"] == loop.loss
    with h5py.File(path) as file:
        np.testing.assert_array_equal(file["separation"], loop.separation)


def test_a_bit_that_is_flipped_is_found(content: bytes, tmp_path: Path) -> None:
    path, draw = tmp_path / "loop.nc", random.Random(5)
    for _ in range(1000):
        damaged = bytearray(content)
        damaged[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
        path.write_bytes(damaged)
        assert "checksum" in refusal(path)


def test_a_file_that_was_cut_off_or_goes_on_is_refused(content: bytes, tmp_path: Path) -> None:
    path, draw = tmp_path / "loop.nc", random.Random(6)
    sizes = [0, 1, SEAL, len(content) - SEAL, len(content) - 1]
    sizes += [draw.randrange(len(content)) for _ in range(295)]
    for size in sizes:
        path.write_bytes(content[:size])
        assert "so a loop's save did not write it (adhesis.open" in refusal(path)
    for more in (b"\0", b"x" * SEAL, content[-SEAL:]):
        path.write_bytes(content + more)
        assert "checksum" in refusal(path)


def test_another_program_that_writes_leaves_no_checksum(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "loop.nc"
    path.write_bytes(content)
    with h5py.File(path, "r+") as file:
        file.attrs["note"] = "mine"
    assert "checksum" in refusal(path)


STRESS = "mean_stress"


def moved(file: h5py.File, _: Path) -> None:
    file.move("mean_stress", "tangent_2")
    put(file, h5py.SoftLink("/tangent_2"), STRESS)


def pipe(folder: Path) -> h5py.ExternalLink:
    return h5py.ExternalLink(str(folder / "pipe"), "/x")


ALL = h5py.h5f.UNLIMITED
BOMB = {"shape": (2**33,), "chunks": (2**20,), "compression": "gzip"}
CRAFTED: dict[str, Callable[[h5py.File, Path], object]] = {
    "a link to a pipe": lambda file, folder: put(file, pipe(folder), STRESS),
    "one more link to a pipe": lambda file, folder: put(file, pipe(folder), "more"),
    "a link inside": moved,
    "external storage": lambda file, _: made(file, STRESS, external=[("/etc/passwd", 0, ALL)]),
    "a virtual dataset": lambda file, folder: virtual(
        file, STRESS, str(folder / "loop.nc"), "separation"
    ),
    "a bomb": lambda file, _: made(file, STRESS, **BOMB),
    "a group": lambda file, _: put(file.create_group("more"), file["/"], "up"),
    "a group in place": lambda file, _: (file.__delitem__(STRESS), file.create_group(STRESS)),
}


@pytest.mark.parametrize("name", CRAFTED)
def test_what_would_be_read_from_elsewhere_or_fill_the_memory_is_refused(name, content, tmp_path):
    path, pipe = tmp_path / "loop.nc", tmp_path / "pipe"
    os.mkfifo(pipe)
    path.write_bytes(content[:-SEAL])
    with h5py.File(path, "r+") as file:
        CRAFTED[name](file, tmp_path)
    path.write_bytes(sealed(path.read_bytes()))
    assert "checksum" not in refusal(path)


def test_a_file_that_is_only_sealed_anew_is_loaded(loop, content, tmp_path):
    """Else the crafted files above could be refused for their checksum alone."""
    path = tmp_path / "loop.nc"
    path.write_bytes(content[:-SEAL])
    with h5py.File(path, "r+") as file:
        file["mean_stress"][3] = file["mean_stress"][3]
    path.write_bytes(sealed(path.read_bytes()))
    assert adhesis.load(path) == loop
