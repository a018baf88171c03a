"""Start ranks from within a program: choose ``mpirun``, number of cores and environment.

Every Python process of adhesis is started by :func:`python` in :func:`python_environment`: neither
lets it import from the working directory, where a user's ``numpy.py`` may lie.

A rank has one thread: the ranks share the cores, small matrices gain nothing from threads, and the
last bits of sums split over threads would depend on their number.
"""

from __future__ import annotations

import ctypes
import os
import re
import resource
import selectors
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from types import FrameType
from typing import NamedTuple

from adhesis import _version
from adhesis.ensemble.errors import InputError, WriteError, lack
from adhesis.ensemble.escape import one_line, printable
from adhesis.ensemble.exit_codes import BAD_INPUT, INTERRUPTED, KILLED, RESUME
from adhesis.ensemble.reporter import log
from adhesis.ensemble.run.interrupt import in_main_thread, stop_signals

# Variables that a launcher sets for its ranks. A second launcher that inherits them passes for one
# of those ranks: both wait for each other, or end without a message.
_RANK_MARKS = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "PMI_SIZE")
_LAUNCHER_PREFIXES = ("OMPI_", "OPAL_", "ORTE_", "PRTE_", "PMIX_", "PMI_", "HYDI_", "HYDRA_")


ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
# Set for ranks that :func:`run_ranks` starts, which start none themselves: the file to which they
# write their exit code and last message. After a nonzero exit code mpirun prints a page of text, in
# which the message of the rank is lost.
STARTED = "ADHESIS_STARTED"
# Beside that file: the name of the signal that :func:`run_ranks` has passed on as SIGUSR1.
_SIGNAL = ".signal"
# Begins each line of such a rank. All that a launcher prints without it is its own, or a library's.
# Two begin what only this module reads: that the ranks have met, or an exit code and a message.
_MARK = "\x1e"
_RANKS_PER_CORE = 16

# s in which the ranks have to meet. On a busy machine they take 20 s, from a cold network disk a
# minute; a second start, from a warm one, is quicker.
_MEETING = 120.0
# s from the exit code of the ranks to a message, and from there to the end of a launcher that goes
# on. Open MPI 4.1.4 was seen to hang once all ranks had ended, in PMIx_server_finalize.
_LAUNCHER_ENDS, _LAUNCHER_KILLED = 10.0, 15.0
_TERMINATED = 5.0  # s that a launcher has to end its ranks, until it is killed
_LOOK_EVERY = 0.5  # s
_MOST_WORDS = 100  # lines of a launcher that are kept

_AGAIN = "what was done is kept, run the same command again to resume"

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
    return launcher() if find_spec("mpi4py") is not None else None


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
    """Raise WriteError under a limit of file sizes with which ranks cannot share memory.

    Open MPI 4.1 hangs there, or its ranks crash, before any of them has begun.
    """
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    if limit != resource.RLIM_INFINITY and limit < _SHARED_BYTES:
        raise WriteError(
            "ranks share memory in files of some MB, and the limit of file sizes (ulimit -f) is "
            f"{limit / 1e6:g} MB: raise it to {_SHARED_BYTES / 1e6:.0f} MB, or leave --ranks out"
        )


def hand_over(code: int, sentence: str = "") -> bool:
    """Pass exit code and last message to the process that started the ranks.

    Returns False if there is none.
    """
    started = os.environ.get(STARTED, "")
    if not started:
        return False
    try:
        with open(started, "r+", encoding="utf-8", errors="backslashreplace") as stream:
            stream.write(f"{code}\n{sentence}")
    except OSError:  # on another node there is no such file
        _report(f"{code} {' '.join(sentence.split())}")
    return True


def is_started() -> bool:
    """Check whether this process is a rank that :func:`run_ranks` has started."""
    return bool(os.environ.get(STARTED))


def report_meeting() -> None:
    """Report that the ranks see each other, to the process that started them."""
    if is_started():
        _report("")


def _report(text: str) -> None:
    sys.stderr.flush()
    with suppress(OSError):
        os.write(2, f"{2 * _MARK}{text}\n".encode(errors="backslashreplace"))


def marked(data: bytes, within: bool) -> bytes:
    """Mark the lines of a started rank; ``within``: the data go on with a line."""
    line = re.compile(rb"[^\n]*\n|[^\n]+")
    lines = line.findall(data)
    return b"".join(
        text if within and i == 0 else _MARK.encode() + text for i, text in enumerate(lines)
    )


def described_signal(name: str) -> str:
    """Return which signal stops a run: of ranks that are started here, the one to the starter."""
    started = os.environ.get(STARTED, "")
    if name == "SIGUSR1" and started:
        with suppress(OSError):  # that process got SIGUSR1 itself, or is on another node
            name = Path(started + _SIGNAL).read_text() or name
    return _described(name)


def _described(name: str) -> str:
    return "Ctrl-C (SIGINT)" if name == "SIGINT" else name


class RanksEnd(NamedTuple):
    """How ranks have ended."""

    # The one that a rank passed on. Without one: 0 if the launcher ended with it, 2 if the ranks
    # have never met, 75 or 130 after a signal, and 137 otherwise.
    code: int
    sentence: str = ""  # the last message, to be printed
    words: tuple[str, ...] = ()  # lines of the launcher, if it gives the reason


def run_ranks(
    launcher: str,
    ranks: int,
    words: Sequence[str],
    program: Sequence[str] | None = None,
    output: Callable[[str], None] = log,
) -> RanksEnd:
    """Start ranks with a command of adhesis and wait for their end (InputError).

    ``program`` runs instead of adhesis with these arguments; ``output`` takes each line of the
    ranks. Of the launcher's exit code only 0 counts: launchers end with 1, and with other codes of
    adhesis, for reasons of their own.

    In the main thread, SIGTERM, SIGHUP, SIGUSR1 and Ctrl-C stop the ranks in order; a second Ctrl-C
    ends them at once. If this process is killed, the launcher ends them. A launcher whose ranks do
    not meet in time, or that does not end soon after the ranks have passed on an exit code, is
    ended.
    """
    check_file_size_limit()
    # With -m mpi4py, an error that a rank does not handle ends the others, too.
    program = program or python("-m", "mpi4py", "-m", "adhesis")
    with ExitStack() as stack:
        try:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="adhesis-"))
            handed_over = Path(folder, "end")
            handed_over.touch()
            started = {STARTED: str(handed_over)}
            process = subprocess.Popen(
                [launcher, "-n", str(ranks), *program, *words],
                env=python_environment(launch_environment(ranks)) | ONE_THREAD | started,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                # else Ctrl-C reaches mpirun, which ends its ranks without a stop in order
                process_group=0,
                # else ranks would continue and keep the results file locked
                preexec_fn=end_with_parent,
            )
        except OSError as error:
            if lack(error):
                raise
            reason = error.strerror or str(error)
            raise InputError(f"{launcher} cannot be started: {reason}") from error
        launched = _Launched(Path(launcher).name, process, handed_over, output)
        stack.callback(launched.end)
        with _signals_passed_to(launched):
            launched.follow()
        code, _, sentence = handed_over.read_text(encoding="utf-8").partition("\n")
        return RanksEnd(int(code), sentence) if code else launched.end_without_code()


class _Launched:
    """A launcher that runs: what its ranks print and report, and whether it hangs."""

    def __init__(
        self,
        name: str,
        process: subprocess.Popen[bytes],
        handed_over: Path,
        output: Callable[[str], None],
    ) -> None:
        self.process = process
        self._name = name
        self.handed_over = handed_over
        self.met = False
        self.signal = ""  # the name of the first one that was passed on
        self.interrupted_twice = False
        self._output = output
        self._code: RanksEnd | None = None  # from another node
        self._words: list[str] = []
        self._late = False  # the ranks did not meet in time
        # What happens to a launcher that hangs, and when.
        self._started = time.monotonic()
        self._ended: float | None = None  # when the exit code of the ranks was seen
        self._kill_at: float | None = None

    def follow(self) -> None:
        """Read until the launcher has ended."""
        pipe = self.process.stdout
        assert pipe is not None
        rest = b""
        with pipe, selectors.DefaultSelector() as selector:
            selector.register(pipe, selectors.EVENT_READ)
            while True:
                if selector.select(_LOOK_EVERY):
                    data = os.read(pipe.fileno(), 2**16)
                    *lines, rest = (rest + data).split(b"\n")
                    for line in lines:
                        self._read(line.decode(errors="replace"))
                    if not data:
                        break
                elif self.process.poll() is not None:
                    break  # another process may hold the pipe
                self._look()
        self._read(rest.decode(errors="replace"))
        while self.process.poll() is None:
            self._look()
            time.sleep(0.01)

    def _read(self, line: str) -> None:
        """Read a line, in which those of several processes may have mixed."""
        own, *of_ranks = re.split(f"({_MARK}+)", line)
        own = own.strip("\0\r")
        if own.strip() and len(self._words) < _MOST_WORDS and [own] != self._words[-1:]:
            self._words.append(own)
        for mark, text in zip(of_ranks[::2], of_ranks[1::2], strict=True):
            text = text.rstrip("\r")
            if mark == _MARK:
                self._output(text)
            elif text:
                code, _, sentence = text.partition(" ")
                self._code = RanksEnd(int(code), sentence)
            else:
                self.met = True

    def _look(self) -> None:
        """End a launcher that hangs."""
        now = time.monotonic()
        if self._kill_at is not None:
            if now > self._kill_at:
                self.process.kill()
        elif self._ended is None:
            if self._code is not None or os.path.getsize(self.handed_over):
                self._ended = now
            elif not self.met and now > self._started + _MEETING:
                self._late = True
                self.terminate()
        elif now > self._ended + _LAUNCHER_ENDS:
            left = f"{_LAUNCHER_KILLED:.0f} s"
            log(f"the run is over, but its launcher has not ended: it is ended in {left}")
            self._kill_at = now + _LAUNCHER_KILLED

    def terminate(self) -> None:
        """End the launcher, which ends its ranks; kill it if it does not end."""
        self.process.terminate()
        self._kill_at = time.monotonic() + _TERMINATED

    def end(self) -> None:
        """End a launcher that was left by an exception."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(_TERMINATED)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def end_without_code(self) -> RanksEnd:
        """Return the end of ranks of which none has passed on an exit code here."""
        if self._code is not None or self.process.returncode == 0:
            return self._code or RanksEnd(0)
        if self.interrupted_twice:
            return RanksEnd(INTERRUPTED, f"adhesis run: interrupted; {_AGAIN}")
        if self.signal:
            name = _described(self.signal)
            return RanksEnd(RESUME, f"adhesis run: stopped early: {name} received; {_AGAIN}")
        words = tuple(map(printable, self._words))
        if self.met:
            return RanksEnd(KILLED, f"adhesis run: {self._killed()}", words)
        return RanksEnd(BAD_INPUT, f"adhesis run: {self._apart()}", words)

    def _killed(self) -> str:
        ended = f"{self._name} ended with {self.process.returncode}"
        return f"a rank was killed, or MPI failed ({ended}); {_AGAIN}"

    def _apart(self) -> str:
        ended = f"and ended with {self.process.returncode}"
        how = f"within {_MEETING:g} s and was ended" if self._late else ended
        cause = "for the reason above" if self._words else "without a reason"
        given = ", ".join(settings())
        remedy = f"correct the settings of MPI ({given})" if given else "adhesis doctor tests MPI"
        return f"{self._name} brought no ranks together {how}, {cause}: {remedy}, or omit --ranks"


def settings() -> list[str]:
    """Return the settings of launchers that were made outside their installation."""
    given = [one_line(f"{k}={v}") for k, v in sorted(os.environ.items()) if k.startswith(_SETTINGS)]
    files = (Path(os.path.expanduser("~"), name, "mca-params.conf") for name in _SETTINGS_FOLDERS)
    return [*given, *(str(path) for path in files if path.is_file())]


@contextmanager
def _signals_passed_to(launched: _Launched) -> Iterator[None]:
    """Turn signals to this process into stops of the ranks, by SIGUSR1, which mpirun passes on.

    Ranks that have not met could not stop in order: the launcher ends them. Only the main thread of
    a process handles signals.
    """
    interrupted = False

    def stop(number: int, _: FrameType | None) -> None:
        nonlocal interrupted
        again = interrupted and number == signal.SIGINT
        name = signal.Signals(number).name
        with suppress(OSError):  # the ranks report SIGUSR1 without it
            Path(f"{launched.handed_over}{_SIGNAL}").write_text(name)
        launched.signal = launched.signal or name
        launched.interrupted_twice = launched.interrupted_twice or again
        if again or not launched.met:
            launched.terminate()
        else:
            launched.process.send_signal(signal.SIGUSR1)
        interrupted = interrupted or number == signal.SIGINT

    numbers = stop_signals() if in_main_thread() else ()
    before = {number: signal.signal(number, stop) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
