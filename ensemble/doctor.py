"""Which MPI, HDF5, FFTW and writer this installation has, and why.

Nothing is assumed: a separate process loads the libraries, and two ranks started by ``mpirun`` say
whether they see each other and write one file together. Those processes get a time limit and a
clean environment, so that a broken MPI can neither hang the caller nor be blamed on it.

``versions()`` is the cheap part, for the attributes of a results file.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

# What a launcher tells its ranks. A program that passes it on to a launcher of its own is taken
# for one of those ranks, and both wait for each other or end without a word.
_RANK_MARKS = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "PMI_SIZE")
_LAUNCHER_PREFIXES = ("OMPI_", "OPAL_", "ORTE_", "PRTE_", "PMIX_", "PMI_", "HYDI_", "HYDRA_")
_PACKAGES = ("hysteron", "numpy", "scipy", "numba", "pyfftw", "h5py", "mpi4py")
_RANKS = 2
_TIME_LIMIT = 60.0  # s; the first load of the libraries from a cold network disk is slow


@dataclass(frozen=True)
class Check:
    """One thing that was tried."""

    name: str
    ok: bool
    text: str
    needed: bool = True  # without it the installation is not usable


@dataclass(frozen=True)
class Diagnosis:
    """What `examine` found."""

    versions: dict[str, str]
    cores: int
    mpirun: str
    mpirun_version: str
    writer: str  # "mpio" or "rank 0"
    why: str
    checks: list[Check] = field(default_factory=list)

    @property
    def usable(self) -> bool:
        """Whether a campaign can run here: every check that is needed passed."""
        return all(check.ok or not check.needed for check in self.checks)

    def as_dict(self) -> dict[str, Any]:
        """For ``--json``."""
        return {
            "usable": self.usable,
            "writer": self.writer,
            "why": self.why,
            "cores": self.cores,
            "mpirun": self.mpirun,
            "mpirun_version": self.mpirun_version,
            "versions": self.versions,
            "checks": [vars(check) for check in self.checks],
        }


def versions() -> dict[str, str]:
    """Version texts by name: python, mpi, hdf5, fftw and the Python packages.

    Does not initialise MPI: where this process has not loaded it, ``mpi`` says so.
    """
    texts = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            texts[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            texts[name] = "not installed"
    texts["hdf5"] = _or_reason(_hdf5_version)
    texts["fftw"] = _or_reason(_fftw_version)
    mpi = sys.modules.get("mpi4py.MPI")
    texts["mpi"] = _short(mpi.Get_library_version()) if mpi else "not loaded"
    return texts


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def launcher() -> str | None:
    """Find this installation's ``mpirun``: ``$MPIRUN``, set-up's choice, or the one in PATH."""
    recorded = Path(sys.prefix, "mpirun")
    beside = str(Path(sys.executable).parent)
    candidates = [os.environ.get("MPIRUN", "")]
    if recorded.is_file():
        candidates.append(recorded.read_text().strip())
    for name in filter(None, candidates):
        found = shutil.which(name)
        if found:
            return found
    for name in ("mpirun", "mpiexec"):
        found = shutil.which(name, path=beside) or shutil.which(name)
        if found:
            return found
    return None


def launch_environment(ranks: int = _RANKS) -> dict[str, str]:
    """Environment in which a launcher starts ``ranks`` ranks here, also from within a rank.

    As root, or for more ranks than cores, Open MPI must be told that this is meant.
    """
    # A copy of os.environ already lacks what an MPI in this process has put into C's environment.
    nested = any(mark in os.environ for mark in _RANK_MARKS)
    env = {
        name: value
        for name, value in os.environ.items()
        if not (nested and name.startswith(_LAUNCHER_PREFIXES))
    }
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


def examine(directory: Path | str | None = None) -> Diagnosis:
    """Try everything out.

    Parameters
    ----------
    directory : path, optional
        Where two ranks write a file together (and remove it). A parallel file system can differ
        from the default, the folder for temporary files.
    """
    checks = [_loopback()]
    alone = _run_probe([], directory)
    found = alone.reports[0] if alone.reports else {}
    texts = found.get("versions") or versions()
    checks.append(_libraries(alone, texts))

    mpi_loads = bool(found.get("mpi_loads"))
    mpirun = launcher()
    together: _Probe | None = None
    if not mpi_loads:
        checks.append(Check("MPI library", False, texts["mpi"], needed=False))
    elif mpirun is None:
        text = "no mpirun and no mpiexec in PATH; hysteron run works in one process"
        checks.append(Check("ranks", False, text, needed=False))
    else:
        together = _run_probe([mpirun, "-n", str(_RANKS)], directory)
        checks.append(_ranks(together, mpirun))

    parallel = bool(found.get("parallel_hdf5"))
    if not parallel:
        writer, why = "rank 0", f"this h5py has HDF5 {texts['hdf5']} without MPI"
    elif together is None:
        writer, why = "rank 0", "no ranks could be started"
    else:
        written = _writing(together)
        checks.append(written)
        writer = "mpio" if written.ok else "rank 0"
        why = (
            "h5py has parallel HDF5, and ranks wrote a file together"
            if written.ok
            else written.text
        )
    return Diagnosis(
        versions=texts,
        cores=cores(),
        mpirun=mpirun or "",
        mpirun_version=_mpirun_version(mpirun) if mpirun else "",
        writer=writer,
        why=why,
        checks=checks,
    )


# ------------------------------------------------------------------------------------- the checks


@dataclass(frozen=True)
class _Probe:
    """What the processes of one probe reported, and how the command ended."""

    reports: list[dict[str, Any]]
    failure: str  # empty if the command ended well


def _run_probe(launch: list[str], directory: Path | str | None) -> _Probe:
    with tempfile.TemporaryDirectory(prefix="hysteron-doctor-", dir=directory) as scratch:
        command = [*launch, sys.executable, "-m", "ensemble.doctor", scratch]
        if launch:
            command.append("together")
        env = launch_environment()
        # The ranks must find this very package, whatever the working directory is.
        here = str(Path(__file__).resolve().parent.parent)
        env["PYTHONPATH"] = os.pathsep.join(filter(None, [here, env.get("PYTHONPATH", "")]))
        failure = _failure_of(command, env)
        reports = [_read_report(path) for path in sorted(Path(scratch).glob("report-*.json"))]
        return _Probe([report for report in reports if report], failure)


def _failure_of(command: list[str], env: dict[str, str]) -> str:
    """Run it to its end or the time limit; empty if it ended well."""
    try:
        process = subprocess.Popen(
            command,
            env=env,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
    except OSError as error:
        return str(error)
    try:
        output, _ = process.communicate(timeout=_TIME_LIMIT)
    except subprocess.TimeoutExpired:
        process.terminate()  # a launcher then ends its ranks, which a kill would leave behind
        try:
            process.communicate(timeout=5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
        return f"did not end within {_TIME_LIMIT:.0f} s"
    if process.returncode:
        return f"ended with {process.returncode}: {_last_lines(output)}"
    return ""


def _read_report(path: Path) -> dict[str, Any]:
    try:
        report: dict[str, Any] = json.loads(path.read_text())
    except (OSError, ValueError):  # the process ended while it wrote
        return {}
    return report


def _loopback() -> Check:
    try:
        with socket.create_server(("127.0.0.1", 0)) as server:
            socket.create_connection(server.getsockname(), timeout=5).close()
    except OSError as error:
        text = f"127.0.0.1 cannot be reached ({error}); launchers talk to their ranks through it"
        return Check("loopback", False, text, needed=False)
    return Check("loopback", True, "up")


def _libraries(probe: _Probe, texts: Mapping[str, str]) -> Check:
    if not probe.reports:
        return Check("libraries", False, f"a process that loads them {probe.failure}")
    broken = [
        f"{name}: {texts[name]}" for name in ("hdf5", "fftw") if not texts[name][:1].isdigit()
    ]
    return Check("libraries", not broken, "; ".join(broken) or "HDF5 and FFTW load")


def _ranks(probe: _Probe, mpirun: str) -> Check:
    sizes = [report["size"] for report in probe.reports if "size" in report]
    if sizes == [_RANKS] * _RANKS:
        return Check("ranks", True, f"mpirun -n {_RANKS} gives {_RANKS} ranks that see each other")
    if len(sizes) == _RANKS and set(sizes) == {1}:
        library = probe.reports[0]["versions"]["mpi"]
        text = (
            f"{mpirun} -n {_RANKS} gives {_RANKS} processes that do not see each other: it belongs "
            f"to another MPI than mpi4py's ({library}); set MPIRUN to that one's"
        )
    else:
        text = f"{mpirun} -n {_RANKS} {probe.failure or f'gave {len(sizes)} ranks'}"
    return Check("ranks", False, text)


def _writing(probe: _Probe) -> Check:
    name = "mpio writing available"
    outcomes = [report.get("mpio", "not tried") for report in probe.reports]
    if outcomes == ["ok"] * _RANKS:
        return Check(name, True, f"yes: {_RANKS} ranks wrote one file together, and it read back")
    reasons = sorted({text for text in outcomes if text != "ok"})
    return Check(name, False, "no: " + ("; ".join(reasons) or probe.failure or "no rank answered"))


def _mpirun_version(mpirun: str) -> str:
    try:
        done = subprocess.run(
            [mpirun, "--version"],
            env=launch_environment(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=_TIME_LIMIT,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    # Open MPI says it in its first line, MPICH's Hydra in its second.
    return next((line for line in lines if any(c.isdigit() for c in line)), "")


# ----------------------------------------------------------------------------- inside the probe


def _probe(scratch: Path, together: bool) -> None:
    """Load everything, and as one of several ranks write a file together; leave a report."""
    report: dict[str, Any] = {}
    comm: Any = None
    if together:
        from mpi4py import MPI

        comm = MPI.COMM_WORLD
        report["size"] = comm.size
    else:
        # Alone, MPI is loaded but not initialised: that can hang where the network is odd.
        import mpi4py

        mpi4py.rc.initialize = False
        report["mpi_loads"] = True
        try:
            importlib.import_module("mpi4py.MPI")
        except (ImportError, RuntimeError) as error:
            report["mpi_loads"] = False
            reason = _last_lines(str(error))
    report["versions"] = versions()
    if report.get("mpi_loads") is False:
        report["versions"]["mpi"] = f"does not load: {reason}"
    parallel = False
    try:
        import h5py

        parallel = bool(h5py.get_config().mpi)
    except ImportError:
        pass  # versions() has the reason
    report["parallel_hdf5"] = parallel
    if comm is not None and comm.size > 1:
        report["mpio"] = (
            _write_together(scratch / "together.h5", comm) if parallel else "serial h5py"
        )
    (scratch / f"report-{os.getpid()}.json").write_text(json.dumps(report))


def _write_together(path: Path, comm: Any) -> str:
    """Lay a file out collectively and write one row a rank: "ok" or the reason."""
    import h5py
    import numpy as np

    try:
        with h5py.File(path, "w", driver="mpio", comm=comm) as file:
            rows = file.create_dataset("rows", (comm.size, 1000), dtype="f8")
            with rows.collective:
                rows[comm.rank] = comm.rank
            file.flush()
            rows[comm.rank, 0] = comm.rank + 0.5
        comm.Barrier()
        with h5py.File(path, "r") as file:
            expected = np.repeat(np.arange(comm.size, dtype=float)[:, None], 1000, axis=1)
            expected[:, 0] += 0.5
            if not np.array_equal(file["rows"][()], expected):
                return "the file does not hold what was written"
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        return _last_lines(str(error))
    return "ok"


# ------------------------------------------------------------------------------------------ texts


def _hdf5_version() -> str:
    import h5py

    return f"{h5py.version.hdf5_version}{' (parallel)' if h5py.get_config().mpi else ''}"


def _fftw_version() -> str:
    import pyfftw

    text = str(pyfftw.fftw_version)  # such as "fftw-3.3.10-sse2-avx"
    return text.removeprefix("fftw-")


def _or_reason(text: Callable[[], str]) -> str:
    try:
        return text()
    except (ImportError, RuntimeError, OSError, AttributeError) as error:
        return f"does not load: {_last_lines(str(error))}"


def _short(library: str) -> str:
    """Cut an MPI's description of itself, which can be a page of build options, to its name."""
    lines = library.strip("\0 \n").splitlines() or ["unknown"]
    return " ".join(lines[0].split(", ident")[0].split())


def _last_lines(text: str, count: int = 2) -> str:
    lines = [" ".join(line.split()) for line in text.splitlines()]
    # Rulers and empty lines of a launcher's message say nothing.
    telling = [line for line in lines if any(c.isalnum() for c in line)]
    return " / ".join(telling[-count:])[:300] or "no message"


if __name__ == "__main__":
    _probe(Path(sys.argv[1]), together=len(sys.argv) > 2)
