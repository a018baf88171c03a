"""Test which MPI, HDF5, FFTW and writer this installation has, and report why.

A separate process loads the libraries, and two ranks started by ``mpirun`` report whether they see
each other and can write one file together. The processes have a time limit and a clean environment,
so that a broken MPI cannot hang the caller, and the caller's environment cannot break an MPI.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from adhesis.ensemble.errors import WriteError
from adhesis.ensemble.run.launch import (
    check_file_size_limit,
    cores,
    end_with_parent,
    launch_environment,
    launcher,
    python,
    python_environment,
    settings,
)
from adhesis.ensemble.versions import first_lines, installed, last_lines, processor

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
    alone = _run_probe([], directory)
    found = alone.reports[0] if alone.reports else {}
    texts = found.get("versions") or installed()
    checks = [_libraries(alone, texts), _kernels()]
    mpi_loads = bool(found.get("mpi_loads"))
    mpirun = launcher()
    together: _Probe | None = None
    if not mpi_loads:
        checks.append(Check("MPI library", False, texts["mpi"], needed=False))
    elif mpirun is None:
        text = "no mpirun and no mpiexec in PATH; adhesis run --ranks starts processes instead"
        checks.append(Check("ranks", False, text, needed=False))
    else:
        together = _run_probe([mpirun, "-n", str(_RANKS)], directory)
        checks.append(_ranks(together, mpirun))

    parallel = bool(found.get("parallel_hdf5"))
    if not parallel:
        writer, why = "rank 0", f"this h5py has HDF5 {texts['hdf5']}"
    elif together is None:
        writer, why = "rank 0", "no ranks could be started"
    else:
        written = _writing(together)
        checks.append(written)
        writer, why = "rank 0", written.text
        if written.ok:
            writer, why = "mpio", "h5py has parallel HDF5, and ranks wrote a file together"
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
    """Reports of the processes of one probe, and the end of their command."""

    reports: list[dict[str, Any]]
    failure: str  # empty if the command ended well


def _run_probe(launch: list[str], directory: Path | str | None) -> _Probe:
    try:
        if launch:
            check_file_size_limit()
        with tempfile.TemporaryDirectory(prefix="adhesis-doctor-", dir=directory) as scratch:
            command = [*launch, *python("-m", "adhesis.ensemble.doctor.probe", scratch)]
            if launch:
                command.append("together")
            code, output = _run(command)
            failure = "" if code == 0 else f"did not end within {_TIME_LIMIT:.0f} s"
            if code:
                # of several processes, the first page has the reason, of one the last lines
                lines = first_lines(output) if launch else last_lines(output)
                failure = f"ended with {code}: {lines}"
            reports = []
            for path in sorted(Path(scratch).glob("report-*.json")):
                with suppress(OSError, ValueError):  # the process ended while it wrote
                    reports.append(json.loads(path.read_text()))
            return _Probe(reports, failure)
    except (OSError, WriteError) as error:
        return _Probe([], f"cannot be started: {error}")


def _run(command: list[str]) -> tuple[int | None, str]:
    """Return the exit code of a command and what it wrote; None if it passed the time limit."""
    process = subprocess.Popen(
        command,
        env=python_environment(launch_environment(_RANKS)),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        preexec_fn=end_with_parent,
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


def _libraries(probe: _Probe, texts: Mapping[str, str]) -> Check:
    if not probe.reports:
        return Check("libraries", False, f"a process that loads them {probe.failure}")
    broken = [
        f"{name}: {texts[name]}" for name in ("hdf5", "fftw") if not texts[name][:1].isdigit()
    ]
    return Check("libraries", not broken, "; ".join(broken) or "HDF5 and FFTW load")


def _kernels() -> Check:
    try:
        from adhesis.solver import _kernels
    except ImportError as error:
        return Check("kernels", False, f"do not load: {last_lines(str(error))}")
    return Check("kernels", True, f"{_kernels.COMPILER}, on {processor()}")


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
        if given := ", ".join(settings()):
            text += f"; settings of MPI: {given}"
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
        _, output = _run([mpirun, "--version"])
    except OSError as error:
        return str(error)
    lines = [" ".join(line.split()) for line in output.splitlines()]
    # The version is in the first line of Open MPI, in the second of MPICH's Hydra.
    return next((line for line in lines if any(c.isdigit() for c in line)), "")
