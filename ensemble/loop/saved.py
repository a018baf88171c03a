"""A loop or path as tables with units, as a labelled dataset, and as a netCDF file.

HDF5 can crash over damaged bytes of its own, and takes those of its data as they are. So behind the
end of the netCDF file, where its readers do not look, stands the SHA-256 of all bytes before, which
is compared before HDF5 reads a byte. Another program that changes the file leaves the checksum
wrong or cuts it off.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import xarray as xr

from adhesis._version import __version__
from adhesis.ensemble.errors import InputError
from adhesis.ensemble.files import check_ending, check_outputs, open_regular, whole_file
from adhesis.ensemble.loop.record import Result
from adhesis.ensemble.quantities import units_under, with_units
from adhesis.solver import checks
from adhesis.solver.loading.loop_result import LoopResult
from adhesis.solver.loading.path import MinorLoop, PathResult
from adhesis.solver.loading.zero_range import InteriorTension
from adhesis.solver.method import MethodReport
from adhesis.solver.model.control import Control
from adhesis.solver.model.half_space import HalfSpace
from adhesis.solver.model.jump import Jump
from adhesis.solver.model.pattern import AdhesionPattern
from adhesis.solver.model.problem import Problem
from adhesis.solver.model.profile import Profile

_KINDS: dict[str, type[Result]] = {"loop": LoopResult, "path": PathResult}
_KIND = "adhesis_result"
_NOT_KEPT = {"problem", "method", "contact_states", "new_method"}
_PARTS: dict[str, tuple[str, type]] = {"jumps": ("jump", Jump), "minor_loops": ("minor", MinorLoop)}
_TYPES = {"float": float, "int": np.int64, "bool": bool}  # of jumps and minor loops; else texts
_MARK = b"\nadhesis SHA-256 "
_LENGTH = len(_MARK) + 2 * hashlib.sha256().digest_size + 1
_MOST_BYTES = 2**31  # a path of a million states has a tenth of it


@dataclass(frozen=True)
class SavedReport(MethodReport):
    """Report of a method on itself from before its loop was saved."""

    # Settings and counters by name; each is an attribute as well
    details: dict[str, Any] = field(default_factory=dict)

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["details"][name]
        except KeyError:
            raise AttributeError(name) from None


def to_dataframe(result: Result, of: str) -> Any:
    """Return states or jumps as a table; see :meth:`adhesis.LoopResult.to_dataframe`."""
    checks.choice("of", of, ("states", "jumps"))
    if of == "jumps":
        names = [*(entry.name for entry in fields(Jump)), "penetration"]
        names += ["leg"] if isinstance(result, PathResult) else []
        return with_units(pd.DataFrame(result.jump_rows(), columns=names))
    return with_units(pd.DataFrame(result.columns()))


def to_xarray(result: Result) -> xr.Dataset:
    """Return a labelled dataset; see :meth:`adhesis.LoopResult.to_xarray`."""
    variables: dict[str, Any] = {}
    kind = "path" if isinstance(result, PathResult) else "loop"
    about: dict[str, Any] = {_KIND: kind, "adhesis_version": __version__}
    problem = result.problem
    is_load = problem.control.is_load
    units = {**units_under(is_load), "tangent": "m/Pa" if is_load else "Pa/m"}

    def variable(dim: str, name: str, values: Any) -> tuple[str, Any, dict[str, str]]:
        return dim, values, {"units": units.get(name, "1")}

    for entry in fields(result):
        value = getattr(result, entry.name)
        if entry.name in _NOT_KEPT:
            continue
        if entry.name in _PARTS:
            dim, part = _PARTS[entry.name]
            for column in fields(part):
                entries = [getattr(one, column.name) for one in value]
                array = np.array(entries, dtype=_TYPES.get(str(column.type), str))
                variables[f"{dim}_{column.name}"] = variable(dim, column.name, array)
        elif isinstance(value, np.ndarray):
            dim = "jump" if entry.name == "jump_leg" else "state"
            variables[entry.name] = variable(dim, entry.name, value)
        elif is_dataclass(value) and not isinstance(value, type):
            about[entry.name] = json.dumps(asdict(value))
        elif value is not None:
            about[entry.name] = np.array(value) if isinstance(value, tuple) else value
    waves = [("harmonic", "coefficient", problem.profile.coefficients)]
    if problem.pattern is not None:
        waves.append(("pattern_harmonic", "pattern", problem.pattern.coefficients))
    for dim, stem, found in waves:
        for name, values in ((f"{stem}_real", found.real), (f"{stem}_imag", found.imag)):
            variables[name] = variable(dim, name, np.array(values))
    for name, value in result.numbers().items():
        if value is not None:
            about[name] = int(value) if isinstance(value, bool) else value  # netCDF has no booleans
    report = asdict(result.method)
    report |= report.pop("details", {})  # of one that was saved before
    about |= {
        "stiffness": problem.control.stiffness,
        "strength": problem.strength,
        "method": json.dumps(report, default=lambda v: v.tolist()),
    }
    return xr.Dataset(variables, attrs=about)


def write_csv(path: Path, results: Sequence[Result]) -> None:
    """Write the states as a CSV, one row each, with units in the header (OSError).

    Of several loops the first column is the turning point, or the preload.
    """
    tables = [to_dataframe(result, "states") for result in results]
    units = tables[0].attrs["units"] | {"penetration": "h_max"}
    if isinstance(results[0], LoopResult) and len(results) > 1:
        turn = "turning_point" if results[0].preload is None else "preload"
        at_stress = results[0].problem.control.is_load or turn == "preload"
        units[turn] = "Pa" if at_stress else "h_max"
        for table, result in zip(tables, results, strict=True):
            table.insert(0, turn, getattr(result, turn))
    for table in tables:
        table.attrs.clear()  # pandas compares them when it joins tables
    names = {name: f"{name} ({unit})" if unit else name for name, unit in units.items()}
    with whole_file(path) as stream:
        pd.concat(tables).rename(columns=names).to_csv(stream, index=False)


def save(result: Result, path: str | os.PathLike[str]) -> None:
    """Write a netCDF file; see :meth:`adhesis.LoopResult.save`."""
    path = checks.path("path", path)
    check_ending("path", path, ".nc")
    check_outputs({"path": path}, {})
    dataset = to_xarray(result)
    plain = {name: {"_FillValue": None} for name in dataset.variables}  # no value means "missing"
    content = sealed(bytes(dataset.to_netcdf(None, engine="h5netcdf", encoding=plain)))
    with whole_file(path) as stream:
        stream.write(content)


def load(path: str | os.PathLike[str]) -> Result:
    """Read a loop or path that ``save`` has written.

    Parameters
    ----------
    path : path
        A netCDF file.

    Returns
    -------
    LoopResult or PathResult
        Equal to what was saved; without its contact states, so that it cannot be filmed.

    Raises
    ------
    InputError
        If the file is missing, damaged, changed, or none that ``save`` has written.
    TypeError
        If ``path`` is no path.

    References
    ----------
    docs/python.md, "Tables and files"

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import adhesis
    >>> profile, half_space = adhesis.single_wave(1e-6, 1e-3), adhesis.HalfSpace(1e6, 0.5)
    >>> problem = adhesis.Problem(profile, half_space, 0.01)
    >>> method = adhesis.make_method("sharp", problem)
    >>> loop = adhesis.run_loop(method, max_penetration=0.5, load_steps=4)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     loop.save(Path(folder, "loop.nc"))
    ...     adhesis.load(Path(folder, "loop.nc")) == loop
    True
    """
    path = checks.path("path", path)
    try:
        return _result(_read_sealed(path))
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"path is {path}: there is no such file") from None
    except PermissionError:
        raise InputError(f"path is {path}: it cannot be read (permission denied)") from None
    except Exception as error:  # h5py and xarray raise nearly every kind over a crafted file
        what = f"no loop or path that adhesis has saved ({type(error).__name__})"
        raise InputError(f"path is {path}: it is {what}") from error


def _waves(found: xr.Dataset, name: str) -> Any:
    return found[f"{name}_real"].values + 1j * found[f"{name}_imag"].values


def _result(found: xr.Dataset) -> Result:
    kind = _KINDS[found.attrs[_KIND]]
    about = found.attrs
    values: dict[str, Any] = {}
    for entry in fields(kind):
        name = entry.name
        if name in _PARTS:
            dim, part = _PARTS[name]
            columns = [found[f"{dim}_{entry.name}"].values.tolist() for entry in fields(part)]
            values[name] = tuple(part(*row) for row in zip(*columns, strict=True))
        elif name in found:
            array = found[name].values
            values[name] = array.astype(str) if array.dtype.kind == "O" else array
        elif name == "turning_points":
            values[name] = tuple(np.atleast_1d(about[name]).tolist())
        elif name == "interior":
            values[name] = InteriorTension(**json.loads(about[name])) if name in about else None
        elif name in about and name not in _NOT_KEPT:
            values[name] = np.asarray(about[name]).item()
    report = json.loads(about["method"])
    method = SavedReport(report.pop("name"), report.pop("chosen"), report)
    problem = Problem(
        Profile(coefficients=_waves(found, "coefficient"), period=float(about["period"])),
        HalfSpace(float(about["young"]), float(about["poisson"])),
        float(about["work_of_adhesion"]),
        Control(float(about["stiffness"])),
        float(about["strength"]),
        work_of_adhesion_open=float(about["work_of_adhesion_open"]),
        measure=about["measure"],
        pattern=AdhesionPattern(_waves(found, "pattern")) if "pattern_real" in found else None,
    )
    return kind(problem=problem, method=method, **values)


def sealed(content: bytes) -> bytes:
    """Return the bytes of a file with their checksum behind them."""
    return content + _MARK + hashlib.sha256(content).hexdigest().encode() + b"\n"


def _read_sealed(path: Path) -> xr.Dataset:
    """Read a netCDF file that was sealed, as it stands there: nothing is scaled or decoded.

    InputError without its checksum, or if it holds anything but datasets of its own.
    """
    with open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        stream.seek(max(0, size - _LENGTH))
        if not stream.read(len(_MARK)) == _MARK:
            raise InputError(
                f"path is {path}: it has no checksum at its end, so a loop's save did not write it "
                "(adhesis.open opens a campaign's results), or it was cut off or changed"
            )
        if size > _MOST_BYTES:
            raise InputError(f"path is {path}: it has {size / 1e6:.0f} MB, more than any loop")
        stream.seek(0)
        whole = stream.read(size)
    content = whole[:-_LENGTH]
    if whole != sealed(content):
        raise InputError(
            f"path is {path}: it is damaged, as its bytes do not have their checksum; take a copy "
            "of it, or compute the loop again"
        )
    with h5py.File(io.BytesIO(content), "r") as file:
        _check_members(path, file, len(content))
    as_stored: Any = dict.fromkeys(("mask_and_scale", "decode_times", "decode_coords"), False)
    with xr.open_dataset(io.BytesIO(content), engine="h5netcdf", **as_stored) as found:
        return found.load()


def _check_members(path: Path, file: h5py.File, size: int) -> None:
    """Refuse what would be read from elsewhere, or is larger than the file, before it is read."""
    for name in file:
        own = isinstance(file.get(name, getlink=True), h5py.HardLink)
        found: Any = file[name] if own else None
        is_own = isinstance(found, h5py.Dataset) and not (found.is_virtual or found.external)
        if not is_own or (found.size or 0) * found.dtype.itemsize > size:
            otherwise = f"it holds {name!r} otherwise than adhesis saves a loop or path"
            raise InputError(f"path is {path}: {otherwise}")
