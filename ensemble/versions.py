"""What computed a results file: versions for its root attributes."""

from __future__ import annotations

import sys
from importlib import metadata
from pathlib import Path

from ensemble.ranks import library_version


def versions() -> dict[str, str]:
    """Return the versions of hysteron, its commit, Python, numpy, MPI, HDF5 and FFTW."""
    import h5py
    import numpy as np

    return {
        "hysteron_version": hysteron_version(),
        "commit": commit(),
        "python": sys.version.split()[0],
        "numpy": np.__version__,
        "mpi": library_version(),
        "hdf5": h5py.version.hdf5_version + (" parallel" if h5py.get_config().mpi else " serial"),
        "fftw": _fftw_version(),
    }


def hysteron_version() -> str:
    """Return the version of the installed distribution."""
    try:
        return metadata.version("hysteron")
    except metadata.PackageNotFoundError:
        return "unknown"


def commit() -> str:
    """Return the commit of the checkout that this code runs from; "unknown" if it is installed."""
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
    return "unknown"


def _fftw_version() -> str:
    import pyfftw

    version = pyfftw.fftw_version
    return version.decode() if isinstance(version, bytes) else str(version)
