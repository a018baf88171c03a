"""What processes take: the interpreter, ``mpirun``, cores, environment, memory and limits.

Every Python process of adhesis is started by :func:`python` in :func:`python_environment`: neither
lets it import from the working directory, where a user's ``numpy.py`` may lie.

A rank has one thread: the ranks share the cores, small matrices gain nothing from threads, and the
last bits of sums split over threads would depend on their number.
"""

from __future__ import annotations

import ctypes
import os
import resource
import shutil
import signal
import sys
import sysconfig
from collections.abc import Mapping
from pathlib import Path

from adhesis import _version
from adhesis.ensemble.errors import InputError, WriteError, parameter
from adhesis.ensemble.escape import one_line

# Variables that a launcher sets for its ranks. A second launcher that inherits them passes for one
# of those ranks: both wait for each other, or end without a message.
_RANK_MARKS = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "PMI_SIZE")
_LAUNCHER_PREFIXES = ("OMPI_", "OPAL_", "ORTE_", "PRTE_", "PMIX_", "PMI_", "HYDI_", "HYDRA_")

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_RANKS_PER_CORE = 16

# Where users and sites set what a launcher does, beside its own installation.
_SETTINGS = ("OMPI_MCA_", "PRTE_MCA_", "PMIX_MCA_", "HYDRA_", "I_MPI_", "MPICH_", "UCX_", "FI_")
_SETTINGS_FOLDERS = (".openmpi", ".prte", ".pmix")

# Open MPI 4.1 makes files of a little more than 4 MB in /tmp and /dev/shm.
_SHARED_BYTES = 8 * 2**20

_PR_SET_PDEATHSIG = 1  # of Linux's prctl
_LIBC = ctypes.CDLL(None)


def python(*words: str) -> list[str]:
    """Return the command that starts this interpreter without the working directory in its path."""
    return [sys.executable, "-P", *words]


def python_environment(environ: Mapping[str, str] = os.environ) -> dict[str, str]:
    """Return an environment in which a process of :func:`python` imports this very package.

    PYTHONPATH keeps its entries except empty ones, which mean the working directory.
    """
    here = str(Path(_version.__file__).resolve().parent.parent)
    entries = [entry for entry in environ.get("PYTHONPATH", "").split(os.pathsep) if entry]
    # In PYTHONPATH, the folder of installed packages would come before the standard library.
    if here not in (sysconfig.get_path("purelib"), sysconfig.get_path("platlib")):
        entries.insert(0, here)
    return {**environ, "PYTHONPATH": os.pathsep.join(entries)}


def end_with_parent() -> None:
    """Have the system end this process (SIGTERM) when its parent ends in any way; Linux only."""
    if sys.platform == "linux":
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


def cores() -> int:
    """Return the number of cores that this process may use."""
    linux = hasattr(os, "sched_getaffinity")
    return len(os.sched_getaffinity(0)) if linux else os.cpu_count() or 1


def peak_bytes() -> int:
    """Return the largest resident memory of this process so far."""
    try:
        # getrusage also counts the memory of the parent when it started this process.
        with open("/proc/self/status") as status:
            peak = next(line for line in status if line.startswith("VmHWM:"))
        return 1024 * int(peak.split()[1])
    except (OSError, StopIteration):
        unit = 1 if sys.platform == "darwin" else 1024
        return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def launcher() -> str | None:
    """Find this installation's ``mpirun``: ``$MPIRUN``, that of set-up, or the one in PATH."""
    recorded, beside = Path(sys.prefix, "mpirun"), Path(sys.executable).parent
    names = [os.environ.get("MPIRUN"), recorded.read_text().strip() if recorded.is_file() else None]
    for name in ("mpirun", "mpiexec"):
        names += [str(beside / name), name]
    return next(filter(None, map(shutil.which, filter(None, names))), None)


def launch_environment(ranks: int) -> dict[str, str]:
    """Return an environment in which a launcher starts ranks here, also from within a rank.

    Open MPI starts ranks as root, or more ranks than cores, only with the variables set here.
    """
    # A copy of os.environ already lacks what an MPI in this process has put into C's environment.
    nested = any(mark in os.environ for mark in _RANK_MARKS)
    dropped = _LAUNCHER_PREFIXES if nested else ()
    env = {k: v for k, v in os.environ.items() if not k.startswith(dropped)}
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        for prefix in ("OMPI", "PRTE"):
            env[f"{prefix}_ALLOW_RUN_AS_ROOT"] = "1"
            env[f"{prefix}_ALLOW_RUN_AS_ROOT_CONFIRM"] = "1"
    if ranks > cores():
        env["OMPI_MCA_rmaps_base_oversubscribe"] = "1"
        env["OMPI_MCA_hwloc_base_binding_policy"] = "none"
        env["PRTE_MCA_rmaps_default_mapping_policy"] = ":oversubscribe"
        env["PRTE_MCA_hwloc_default_binding_policy"] = "none"
    return env


def check_ranks(ranks: int) -> None:
    """Refuse more ranks than this machine can hold (InputError)."""
    most = _RANKS_PER_CORE * cores()
    if ranks > most:
        from adhesis.solver.checks import counted  # here: it loads numpy

        raise InputError(
            f"{parameter('ranks')} is {ranks}: at most {most} are started here, on "
            f"{counted(cores(), 'core')}; more ranks than cores compute no faster"
        )


def check_file_size_limit() -> None:
    """Raise WriteError under a limit of file sizes with which ranks cannot share memory.

    Open MPI 4.1 hangs there, or its ranks crash, before any of them has begun.
    """
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    if limit != resource.RLIM_INFINITY and limit < _SHARED_BYTES:
        raise WriteError(
            "ranks share memory in files of some MB, and the limit of file sizes (ulimit -f) is "
            f"{limit / 1e6:g} MB: raise it to {_SHARED_BYTES / 1e6:.0f} MB"
        )


def settings() -> list[str]:
    """Return the settings of launchers that were made outside their installation."""
    given = [one_line(f"{k}={v}") for k, v in sorted(os.environ.items()) if k.startswith(_SETTINGS)]
    files = (Path(os.path.expanduser("~"), name, "mca-params.conf") for name in _SETTINGS_FOLDERS)
    return [*given, *(str(path) for path in files if path.is_file())]
