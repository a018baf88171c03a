"""Look up the versions of packages and code, and record how a JSON document came about."""

from __future__ import annotations

import hashlib
import platform
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from adhesis.ensemble.files import open_regular
from adhesis.ensemble.quantities import units_of

_PACKAGES = ("adhesis", "numpy", "scipy", "pyfftw", "h5py", "mpi4py")


def versions() -> dict[str, str]:
    """Return the root attributes of a results file: versions, commit, and the MPI in use."""
    return {**software(), "mpi": _mpi(), "hdf5": _hdf5(), "fftw": _fftw()}


@cache
def software() -> dict[str, str]:
    """Return the versions that decide the bits of a loop, the commit and the processor.

    They are those of the first call: what is loaded stays, whatever is checked out meanwhile.
    """
    return {
        "adhesis_version": _package("adhesis", missing="unknown"),
        "commit": commit(),
        "python": platform.python_version(),
        **{name: _package(name) for name in ("numpy", "scipy")},
        "kernels": _kernels(),
        "processor": processor(),
    }


def adhesis_version() -> str:
    """Return the version of adhesis, with the commit that it runs from where that is known."""
    version, known = _package("adhesis", missing="unknown"), commit()
    return version if known == "unknown" else f"{version} (commit {known[:12]})"


def installed() -> dict[str, str]:
    """Return versions by name: packages, python, mpi, hdf5 and fftw; or why one does not load.

    MPI is not initialised: where this process has not loaded it, ``mpi`` is "not loaded".
    """
    mpi = sys.modules.get("mpi4py.MPI")
    return {
        "python": platform.python_version(),
        **{name: _package(name) for name in _PACKAGES},
        "kernels": _or_reason(_kernels),
        "hdf5": _or_reason(_hdf5),
        "fftw": _or_reason(_fftw),
        "mpi": _short(mpi.Get_library_version()) if mpi else "not loaded",
    }


LAST = slice(-2, None)


def gist(text: object, lines: slice = LAST) -> str:
    """Join some lines of a message that hold letters or digits, by default the last two."""
    joined = [" ".join(line.split()) for line in str(text).splitlines()]
    # A launcher's message ends with rulers and empty lines.
    filled = [line for line in joined if any(c.isalnum() for c in line)]
    return " / ".join(filled[lines])[:300] or "no message"


def commit() -> str:
    """Return the commit that this code runs from or was built from; or "unknown"."""
    built = Path(__file__).with_name("commit.txt")  # CMake writes it into what it builds
    return _checked_out() or (built.read_text().strip() if built.exists() else "unknown")


def _checked_out() -> str | None:
    git = Path(__file__).resolve().parent.parent / ".git"
    try:
        if git.is_file():  # a work tree: "gitdir: PATH"
            git = (git.parent / git.read_text().split(":", 1)[1].strip()).resolve()
        head = (git / "HEAD").read_text().strip()
        if not head.startswith("ref:"):
            return head
        name = head.split(":", 1)[1].strip()
        shared = git / "commondir"
        common = (git / shared.read_text().strip()).resolve() if shared.exists() else git
        loose = common / name
        if loose.exists():
            return loose.read_text().strip()
        for line in (common / "packed-refs").read_text().splitlines():
            if line.endswith(f" {name}"):
                return line.split()[0]
    except (OSError, IndexError):
        pass
    return None


def _package(name: str, missing: str = "not installed") -> str:
    from importlib import metadata  # takes long to load; only rank 0 has a use for it

    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return missing


def _mpi() -> str:
    """Return the MPI library's name and version; "none" where MPI is not in use."""
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is None or not mpi.Is_initialized():
        return "none"
    return _short(mpi.Get_library_version())


def processor() -> str:
    """Return the name of this processor, as the system knows it."""
    with suppress(OSError):  # not Linux
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _kernels() -> str:
    from adhesis.solver._kernels import COMPILER

    return COMPILER


def _hdf5() -> str:
    import h5py

    return f"{h5py.version.hdf5_version} {'parallel' if h5py.get_config().mpi else 'serial'}"


def _fftw() -> str:
    import pyfftw

    version = pyfftw.fftw_version  # such as "fftw-3.3.10-sse2-avx"; bytes in some builds
    text = version.decode() if isinstance(version, bytes) else str(version)
    return text.removeprefix("fftw-")


def _or_reason(text: Callable[[], str]) -> str:
    try:
        return text()
    except (ImportError, RuntimeError, OSError, AttributeError) as error:
        return f"does not load: {gist(error)}"


def _short(library: str) -> str:
    """Cut an MPI's description of itself, which can be a page of build options, to its name."""
    lines = library.strip("\0 \n").splitlines() or ["unknown"]
    return " ".join(lines[0].split(", ident")[0].split())


def input_record(path: Path | None) -> dict[str, Any] | None:
    """Return name, size and checksum of an input file; None for none."""
    if path is None:
        return None
    with open_regular(path) as file:
        checksum = hashlib.file_digest(file, "sha256").hexdigest()
        return {"file": str(path), "bytes": file.tell(), "sha256": checksum}


def provenance(
    words: Sequence[str],
    source: Mapping[str, Any] | None,
    seed: int | None,
    document: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the entry ``provenance`` of a document.

    ``words`` are command and options as they were given, ``source`` is the :func:`input_record`,
    and ``seed`` that of a random profile.
    """
    return {
        **software(),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": shlex.join(["adhesis", *words]),
        "input": source,
        "seed": seed,
        "units": units_of(document),
    }
