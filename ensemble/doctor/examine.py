"""Test which MPI, HDF5, FFTW and writer this installation has, and report why.

A separate process loads the libraries, and two ranks started by ``mpirun`` report whether they see
each other and can write one file together. The processes have a time limit and a clean environment,
so that a broken MPI cannot hang the caller, and the caller's environment cannot break an MPI.
"""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from adhesis.ensemble.errors import WriteError
from adhesis.ensemble.run import launch
from adhesis.ensemble.versions import LAST, gist, installed, processor

Reports = list[dict[str, Any]]
_RANKS = 2
_TIME_LIMIT = 60.0  # s; the first load of the libraries from a cold network disk is slow


@dataclass(frozen=True)
class Check:
    """Result of one test."""

    name: str
    ok: bool
    text: str
    needed: bool = True  # without it the installation is not usable


@dataclass(frozen=True)
class Diagnosis:
    """Result of :func:`examine`."""

    writer: str  # "mpio" or "rank 0"
    why: str
    cores: int
    mpirun: str
    mpirun_version: str
    versions: dict[str, str]
    checks: list[Check]

    @property
    def usable(self) -> bool:
        """Whether a campaign can run here: every check that is needed passed."""
        return all(check.ok or not check.needed for check in self.checks)


def examine(directory: Path | str | None = None) -> Diagnosis:
    """Run all checks; ranks write a file in ``directory``, or where temporary files are."""
    reports, failure = _run_probe([], directory)
    found = reports[0] if reports else {}
    texts = found.get("versions") or installed()
    checks = [_libraries(reports, failure, texts), _kernels()]
    mpirun = launch.launcher()
    together = None
    if not found.get("mpi_loads"):
        checks.append(Check("MPI library", False, texts["mpi"], needed=False))
    elif mpirun is None:
        text = "no mpirun and no mpiexec in PATH; adhesis run --ranks starts processes instead"
        checks.append(Check("ranks", False, text, needed=False))
    else:
        together = _run_probe([mpirun, "-n", str(_RANKS)], directory)
        checks.append(_ranks(*together, mpirun))

    writer = "rank 0"
    if not found.get("parallel_hdf5"):
        why = f"this h5py has HDF5 {texts['hdf5']}"
    elif together is None:
        why = "no ranks could be started"
    else:
        written = _writing(*together)
        checks.append(written)
        why = written.text
        if written.ok:
            writer, why = "mpio", "h5py has parallel HDF5, and ranks wrote a file together"
    version = _mpirun_version(mpirun) if mpirun else ""
    return Diagnosis(writer, why, launch.cores(), mpirun or "", version, texts, checks)


def _run_probe(start: list[str], directory: Path | str | None) -> tuple[Reports, str]:
    """Return the reports of the processes of one probe, and how their command failed, if it did."""
    try:
        if start:
            launch.check_file_size_limit()
        with tempfile.TemporaryDirectory(prefix="adhesis-doctor-", dir=directory) as scratch:
            probe = launch.python("-m", "adhesis.ensemble.doctor.examine", scratch)
            code, output = _run([*start, *probe, *(["together"] if start else [])])
            failure = "" if code == 0 else f"did not end within {_TIME_LIMIT:.0f} s"
            if code:
                # of several processes, the first page has the reason, of one the last lines
                failure = f"ended with {code}: {gist(output, slice(4) if start else LAST)}"
            reports = []
            for path in sorted(Path(scratch).glob("report-*.json")):
                with suppress(OSError, ValueError):  # the process ended while it wrote
                    reports.append(json.loads(path.read_text()))
            return reports, failure
    except (OSError, WriteError) as error:
        return [], f"cannot be started: {error}"


def _run(command: list[str]) -> tuple[int | None, str]:
    """Return the exit code of a command and what it wrote; None if it passed the time limit."""
    process = subprocess.Popen(
        command,
        env=launch.python_environment(launch.launch_environment(_RANKS)),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        preexec_fn=launch.end_with_parent,
    )
    try:
        output, _ = process.communicate(timeout=_TIME_LIMIT)
    except BaseException as error:  # also an interrupt: what was started ends before its folder
        process.terminate()  # a launcher then ends its ranks; a kill would leave them running
        try:
            process.communicate(timeout=5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
        if not isinstance(error, subprocess.TimeoutExpired):
            raise
        return None, ""
    return process.returncode, output


def _libraries(reports: Reports, failure: str, texts: Mapping[str, str]) -> Check:
    if not reports:
        return Check("libraries", False, f"a process that loads them {failure}")
    named = ((name, texts[name]) for name in ("hdf5", "fftw"))
    broken = [f"{name}: {text}" for name, text in named if not text[:1].isdigit()]
    return Check("libraries", not broken, "; ".join(broken) or "HDF5 and FFTW load")


def _kernels() -> Check:
    try:
        from adhesis.solver import _kernels
    except ImportError as error:
        return Check("kernels", False, f"do not load: {gist(error)}")
    return Check("kernels", True, f"{_kernels.COMPILER}, on {processor()}")


def _ranks(reports: Reports, failure: str, mpirun: str) -> Check:
    sizes = [report["size"] for report in reports if "size" in report]
    if sizes == [_RANKS] * _RANKS:
        return Check("ranks", True, f"mpirun -n {_RANKS} gives {_RANKS} ranks that see each other")
    if len(sizes) == _RANKS and set(sizes) == {1}:
        library = reports[0]["versions"]["mpi"]
        text = (
            f"{mpirun} -n {_RANKS} gives {_RANKS} processes that do not see each other: it belongs "
            f"to another MPI than mpi4py's ({library}); set MPIRUN to that one's"
        )
    else:
        text = f"{mpirun} -n {_RANKS} {failure or f'gave {len(sizes)} ranks'}"
        if given := ", ".join(launch.settings()):
            text += f"; settings of MPI: {given}"
    return Check("ranks", False, text)


def _writing(reports: Reports, failure: str) -> Check:
    name = "mpio writing available"
    outcomes = [report.get("mpio", "not tried") for report in reports]
    if outcomes == ["ok"] * _RANKS:
        return Check(name, True, f"yes: {_RANKS} ranks wrote one file together, and it read back")
    reasons = sorted({text for text in outcomes if text != "ok"})
    return Check(name, False, "no: " + ("; ".join(reasons) or failure or "no rank answered"))


def _mpirun_version(mpirun: str) -> str:
    try:
        _, output = _run([mpirun, "--version"])
    except OSError as error:
        return str(error)
    # The version is in the first line of Open MPI, in the second of MPICH's Hydra.
    numbered = (line for line in output.splitlines() if any(c.isdigit() for c in line))
    return " ".join(next(numbered, "").split())


def _report(scratch: Path, together: bool) -> None:
    """Load the libraries, write a file together if one of several ranks, and write a report."""
    found: dict[str, Any] = {"mpi_loads": True}
    reason = ""
    try:
        import mpi4py

        # One process alone does not initialise MPI, which can hang if the network is misconfigured.
        mpi4py.rc.initialize = together
        importlib.import_module("mpi4py.MPI")
    except (ImportError, RuntimeError) as error:
        found["mpi_loads"], reason = False, f"does not load: {gist(error)}"
    found["versions"] = installed() | ({"mpi": reason} if reason else {})
    # "3.0 parallel"; without HDF5 the reason
    parallel = found["parallel_hdf5"] = found["versions"]["hdf5"].endswith("parallel")
    if together:
        from mpi4py import MPI

        comm = MPI.COMM_WORLD
        found["size"] = comm.size
        if comm.size > 1:
            found["mpio"] = "serial h5py"
            if parallel:
                found["mpio"] = _write_together(scratch / "together.h5", comm)
    (scratch / f"report-{os.getpid()}.json").write_text(json.dumps(found))


def _write_together(path: Path, comm: Any) -> str:
    """Create a file collectively and write one row a rank; return "ok" or the reason."""
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
        return gist(error)
    return "ok"


if __name__ == "__main__":
    launch.end_with_parent()
    _report(Path(sys.argv[1]), together=len(sys.argv) > 2)
