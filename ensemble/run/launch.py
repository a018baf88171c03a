"""Start ranks from within a program: choose ``mpirun``, number of cores and environment.

Every Python process of adhesis is started by :func:`python` in :func:`python_environment`: neither
lets it import from the working directory, where a user's ``numpy.py`` may lie.

A rank has one thread: the ranks share the cores, small matrices gain nothing from threads, and the
last bits of sums split over threads would depend on their number.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import resource
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from adhesis import _version
from adhesis.ensemble.errors import WriteError
from adhesis.ensemble.run.interrupt import stop_signals

# Variables that a launcher sets for its ranks. A second launcher that inherits them passes for one
# of those ranks: both wait for each other, or end without a message.
_RANK_MARKS = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "PMI_SIZE")
_LAUNCHER_PREFIXES = ("OMPI_", "OPAL_", "ORTE_", "PRTE_", "PMIX_", "PMI_", "HYDI_", "HYDRA_")


ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
# Set for ranks that :func:`run_ranks` starts, which start none themselves: the file to which they
# write their exit code and last message. After a nonzero exit code mpirun prints a page of text, in
# which the message of the rank is lost.
STARTED = "ADHESIS_STARTED"
# Beside that file: the name of the signal that :func:`run_ranks` has passed on as SIGUSR1.
_SIGNAL = ".signal"
_RANKS_PER_CORE = 16
KILLED = 137  # exit code that a shell reports for a process ended by signal 9


# s from the exit code of the ranks to a message, and from there to the end of a launcher that goes
# on. Open MPI 4.1.4 was seen to hang once all ranks had ended, in PMIx_server_finalize.
_LAUNCHER_ENDS, _LAUNCHER_KILLED = 10.0, 15.0
_LOOK_EVERY = 0.5  # s

# Open MPI reports each signal that it passes on, in a line of its own.
_QUIET = {"OMPI_MCA_orte_execute_quiet": "1"}

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
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def launcher() -> str | None:
    """Find this installation's ``mpirun``: ``$MPIRUN``, that of set-up, or the one in PATH."""
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


def mpi_launcher() -> str | None:
    """Return the ``mpirun`` of :func:`launcher` where ranks can use MPI, else None."""
    return launcher() if importlib.util.find_spec("mpi4py") is not None else None


def launch_environment(ranks: int) -> dict[str, str]:
    """Return an environment in which a launcher starts ranks here, also from within a rank.

    Open MPI starts ranks as root, or more ranks than cores, only with the variables set here.
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


def largest_number_of_ranks(environ: Mapping[str, str] = os.environ) -> int:
    """Return the limit of ranks of :func:`run_ranks`: some for each core of this job's nodes."""
    nodes = environ.get("SLURM_JOB_NUM_NODES", "1")
    return _RANKS_PER_CORE * cores() * (int(nodes) if nodes.isdecimal() else 1)


def check_file_size_limit() -> None:
    """Refuse a limit of file sizes under which ranks cannot share memory.

    Open MPI 4.1 hangs there, or its ranks crash, before any of them has begun.

    Raises
    ------
    WriteError
    """
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    if limit != resource.RLIM_INFINITY and limit < _SHARED_BYTES:
        raise WriteError(
            f"ranks could not be started: they share memory in files of some MB, and the limit of "
            f"file sizes (ulimit -f) is {limit / 1e6:g} MB; raise it to {_SHARED_BYTES / 1e6:.0f} "
            "MB, or leave --ranks out"
        )


def hand_over(code: int, sentence: str = "") -> bool:
    """Pass exit code and last message to the process that started the ranks.

    Returns False if there is none, or if it is on another node.
    """
    try:
        with open(os.environ.get(STARTED, ""), "r+", encoding="utf-8") as stream:
            stream.write(f"{code}\n{sentence}")
    except OSError:
        return False
    return True


def described_signal(name: str) -> str:
    """Return which signal stops a run: of ranks that are started here, the one to the starter."""
    started = os.environ.get(STARTED, "")
    if name == "SIGUSR1" and started:
        with suppress(OSError):  # that process got SIGUSR1 itself, or is on another node
            name = Path(started + _SIGNAL).read_text() or name
    return "Ctrl-C (SIGINT)" if name == "SIGINT" else name


def run_ranks(
    launcher: str,
    ranks: int,
    words: Sequence[str],
    program: Sequence[str] | None = None,
    output: Callable[[str], None] | None = None,
) -> tuple[int, str]:
    """Start ranks with a command of adhesis and wait for their end.

    Returns exit code and last message: those that the ranks passed on, else the exit code of the
    launcher and no message.

    SIGTERM, SIGHUP, SIGUSR1 and Ctrl-C stop the ranks in order; a second Ctrl-C ends them at once.
    If this process is killed, the launcher ends them. A launcher that does not end soon after the
    ranks have passed on an exit code is killed.

    Parameters
    ----------
    launcher : str
        An ``mpirun``.
    ranks : int
    words : sequence of str
        Arguments of ``adhesis``.
    program : sequence of str, optional
        Program that a rank runs instead of adhesis, with these arguments.
    output : callable, optional
        Takes each line that the ranks print; without it they print where this process does.
    """
    check_file_size_limit()
    # With -m mpi4py, an error that a rank does not handle ends the others, too.
    program = program or python("-m", "mpi4py", "-m", "adhesis")
    handle, handed_over = tempfile.mkstemp(prefix="adhesis-")
    started = {STARTED: handed_over}
    env = python_environment(launch_environment(ranks)) | ONE_THREAD | _QUIET | started
    process = subprocess.Popen(
        [launcher, "-n", str(ranks), *program, *words],
        env=env,
        stdin=subprocess.DEVNULL,
        stdout=None if output is None else subprocess.PIPE,
        stderr=None if output is None else subprocess.STDOUT,
        encoding="utf-8",
        errors="replace",
        process_group=0,  # else Ctrl-C reaches mpirun, which ends its ranks without a stop in order
        preexec_fn=end_with_parent,  # else ranks would continue and keep the results file locked
    )
    threading.Thread(target=_see_end, args=(process, handed_over), daemon=True).start()
    with _signals_passed_to(process, handed_over), open(handle, encoding="utf-8") as stream:
        try:
            if process.stdout is not None and output is not None:
                for line in process.stdout:
                    output(line.rstrip("\n"))
            code = process.wait()
        finally:
            os.unlink(handed_over)
            Path(handed_over + _SIGNAL).unlink(missing_ok=True)
        own, _, sentence = stream.read().partition("\n")
    return int(own or code), sentence


def _see_end(process: subprocess.Popen[str], handed_over: str) -> None:
    """Kill a launcher that goes on after its ranks have written the file of their exit code."""
    with suppress(OSError):  # the file goes when the launcher has ended
        while not os.path.getsize(handed_over):
            time.sleep(_LOOK_EVERY)
        time.sleep(_LAUNCHER_ENDS)
        os.stat(handed_over)
        left = f"{_LAUNCHER_KILLED:.0f} s"
        text = f"the run is over, but its launcher has not ended: it is ended in {left}"
        print(text, file=sys.stderr, flush=True)
        time.sleep(_LAUNCHER_KILLED)
        os.stat(handed_over)
        process.kill()


@contextmanager
def _signals_passed_to(process: subprocess.Popen[str], handed_over: str) -> Iterator[None]:
    """Turn signals to this process into stops of the ranks, by SIGUSR1, which mpirun passes on."""
    interrupted = False

    def stop(number: int, _: FrameType | None) -> None:
        nonlocal interrupted
        again = interrupted and number == signal.SIGINT
        with suppress(OSError):  # the ranks report SIGUSR1 without it
            Path(handed_over + _SIGNAL).write_text(signal.Signals(number).name)
        process.send_signal(signal.SIGTERM if again else signal.SIGUSR1)
        interrupted = interrupted or number == signal.SIGINT

    before = {number: signal.signal(number, stop) for number in stop_signals()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
