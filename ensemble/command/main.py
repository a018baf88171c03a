"""Run a command of the command line ``adhesis COMMAND …``.

What holds for all commands is here: how errors, interrupts and failing streams are reported, and
what processes that a launcher started do. A command's module is imported only when it is called, so
that ``status`` and ``report`` never load MPI.
"""

from __future__ import annotations

import importlib
import io
import os
import resource
import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from traceback import walk_stack
from types import FrameType
from typing import Any

from adhesis.ensemble import errors, exit_codes
from adhesis.ensemble.command.parser import Parser
from adhesis.ensemble.reporter import log
from adhesis.ensemble.run.interrupt import in_main_thread
from adhesis.ensemble.run.launch import ONE_THREAD
from adhesis.ensemble.run.ranks import launched

COMMANDS: dict[str, str] = {
    "new": "write a commented campaign file to start from",
    "run": "run or resume a campaign; under mpirun, rank 0 hands out and the others work",
    "status": "report which tasks of a results file are pending, done and failed",
    "verify": "check whether a results file is damaged, and which of its rows",
    "merge": "join the results files of parts, as --part has made them, into one",
    "report": "write tables, curves and figures of a results file",
    "loop": "compute one loop of one profile",
    "trace": "compute the loss of a measured trace, and its uncertainty",
    "sample": "write a sample trace, to try `trace` with",
    "validate": "compare the methods with exact references: error against bound",
    "bench": "measure the speed of each method against its error",
    "doctor": "report which MPI, HDF5, FFTW and writer this installation uses, and why",
    "completion": "print the code with which a shell completes commands and options",
}
EXAMPLES = ("adhesis loop --hurst 0.8 --seed 1", "adhesis run jobs/example.toml --ranks 3")
_WITHOUT_NUMERICS = ("new", "completion")
# Their options are declared in modules of their own, without loading the solver.
_OPTIONS = ("loop", "trace")
# What several processes of a launcher do with a command: the ranks of `run` share its work, and
# these are independent of one another (of other profiles, on other nodes). Rank 0 alone runs the
# rest.
_PARALLEL = "run"
_INDEPENDENT = ("loop", "trace", "doctor")
# How long a process waits for rank 0 to report the same error, whose end makes mpirun end all.
_RANK_0_FIRST = 20.0  # s
# A signal comes again so long after Python has dropped what its handler raised.
_AGAIN = 0.01  # s


def main(argv: list[str] | None = None) -> int:
    """Run one command; returns its exit code (2 for bad input, with one sentence on stderr).

    Of several ranks of a launcher rank 0 alone returns a code that is not 0, after its sentence is
    out: mpirun ends all ranks at the first such code.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    name = words[0] if words else ""
    _write_no_byte_code_under_a_limit()
    rank = launched()[1]
    if rank > 0 and name != _PARALLEL and name not in _INDEPENDENT:
        return 0
    with standard_streams():
        error: BaseException | None = None
        try:
            with _interrupts(name):
                code, sentence = _execute(name, words), ""
                sys.stdout.flush()
        except (Exception, KeyboardInterrupt) as raised:
            (code, sentence), error = exit_codes.ended_by(raised), raised
        if rank > 0 and isinstance(error, errors.InputError):
            if name == _PARALLEL and not isinstance(error, errors.RankError):
                return 0  # rank 0 has the same error
            time.sleep(_RANK_0_FIRST)
        if sentence:
            program = f"adhesis {name}" if name in COMMANDS else "adhesis"
            log(f"{program}: {sentence}")
    return code


def _write_no_byte_code_under_a_limit() -> None:
    """Python 3.11 leaves byte code that a limit of file sizes cuts off, and reads it ever after."""
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    if limit == resource.RLIM_INFINITY:
        return
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"  # nor do ranks
    for module in list(sys.modules.values()):
        path = getattr(module, "__cached__", None)
        with suppress(OSError):
            if path and os.path.getsize(path) == limit:
                os.unlink(path)


def parser_of(name: str) -> Parser:
    """Return the parser of a command."""
    suffix = "_arguments" if name in _OPTIONS else ""
    module = importlib.import_module(f"adhesis.ensemble.command.{name}{suffix}")
    return Parser(f"adhesis {name}", module.__doc__ or "", module.EXAMPLES, module.OPTIONS)


def _execute(name: str, words: Sequence[str]) -> int:
    if name == "--version":
        from adhesis.ensemble.versions import adhesis_version

        print(f"adhesis {adhesis_version()}")
        return 0
    if name in ("", "-h", "--help"):
        _overview().print_help()
        return 0
    if name not in COMMANDS:
        raise errors.InputError(f"COMMAND is {name!r}: it must be one of {', '.join(COMMANDS)}")
    for variable, count in ONE_THREAD.items():
        os.environ.setdefault(variable, count)  # before numpy is loaded
    os.environ.pop("MPLBACKEND", None)  # figures go to files, whatever a site has set for windows
    try:
        args = parser_of(name).parse(words[1:])
    except SystemExit:  # --help
        return 0
    args.words = list(words)
    if name not in _WITHOUT_NUMERICS:
        errors.check_memory()
    with errors.naming_options():
        code: int | None = importlib.import_module(f"adhesis.ensemble.command.{name}").execute(args)
    return code or 0


@contextmanager
def _interrupts(name: str) -> Iterator[None]:
    """Raise KeyboardInterrupt at SIGINT, and Terminated at SIGTERM and SIGHUP.

    So unfinished files are removed. A signal that is ignored, as SIGHUP under ``nohup``, stays so.
    After SIGTERM or SIGHUP both are ignored: a terminal that closes sends two. A run has handlers
    of its own for all but SIGINT.

    What a handler raises while a module is loaded may be lost, or come out as another error; there
    the signal ends the process. What it raises in a finalizer is dropped, and in h5py may come out
    as that of a damaged file; the signal comes again.
    """
    received = 0

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal received
        received = number
        frames = [f for f, _ in walk_stack(frame)]
        packages = {str(f.f_globals.get("__name__")).partition(".")[0] for f in frames}
        if "h5py" in packages or any(f.f_code is dropped.__code__ for f in frames):
            come_again()
            return
        if any(f.f_globals.get("__name__") == "importlib._bootstrap" for f in frames):
            files: Any = sys.modules.get("adhesis.ensemble.files")
            if hasattr(files, "remove_unfinished"):  # it is not being loaded itself
                files.remove_unfinished()
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        for each in before.keys() - {signal.SIGINT}:
            signal.signal(each, signal.SIG_IGN)
        raise errors.Terminated

    def dropped(unraisable: sys.UnraisableHookArgs) -> None:
        if not isinstance(unraisable.exc_value, KeyboardInterrupt):
            hook(unraisable)
            return
        for each in before:
            signal.signal(each, handle)
        come_again()

    def come_again() -> None:
        threading.Timer(_AGAIN, os.kill, (os.getpid(), received)).start()

    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)[: 1 if name == _PARALLEL else 3]
    unhandled = (signal.SIG_DFL, signal.default_int_handler)
    before = {n: was for n in numbers if (was := signal.getsignal(n)) in unhandled}
    if not in_main_thread():
        before.clear()
    for number in before:
        signal.signal(number, handle)
    hook = sys.unraisablehook
    if before:
        sys.unraisablehook = dropped
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, was in before.items():
            signal.signal(number, was)


def _overview() -> Parser:
    listing = "\n".join(f"  {name:<12}{text}" for name, text in COMMANDS.items())
    about = "Hysteresis loops of rough contacts with zero-range (JKR) adhesion."
    commands = f"commands:\n{listing}\n\nadhesis COMMAND --help lists its options."
    parser = Parser("adhesis", f"{about}\n\n{commands}", EXAMPLES)
    parser.add_argument("--version", action="store_true", help="version and commit")
    parser.add_argument("command", metavar="COMMAND")
    return parser


# ---------------------------------------------------------------------- stdout and stderr


class _Output(io.FileIO):
    """File descriptor of stdout or stderr: a message on stderr that cannot be written is lost.

    The first failure of stdout raises, what follows is dropped. Otherwise the interpreter would try
    to write the rest when it ends, and report that failure, too.
    """

    _failed = False

    def write(self, data: Any, /) -> int:
        try:
            if not self._failed:
                return super().write(data) or 0
        except OSError as error:
            self._failed = self.fileno() == 1
            if isinstance(error, BrokenPipeError) and self._failed:
                raise
            if self._failed:
                raise errors.WriteError(
                    f"stdout could not be written: {errors.reason(error)}"
                ) from None
        return memoryview(data).nbytes


@contextmanager
def standard_streams() -> Iterator[None]:
    """Replace the process's own stdout and stderr by safe ones, and open those that are closed.

    Characters that the encoding lacks appear as escapes. A closed stdout fails when something is
    printed. Streams that are not the process's own (of a notebook, of a test) stay as they are.
    """
    _open_closed_descriptors()
    before = sys.stdout, sys.stderr
    if sys.stdout is sys.__stdout__:
        sys.stdout = _stream(sys.stdout, io.BufferedWriter(_Output(1, "w", closefd=False)))
    if sys.stderr is sys.__stderr__:
        sys.stderr = _stream(sys.stderr, io.BufferedWriter(_Output(2, "w", closefd=False)), True)
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(errors.WriteError, OSError, ValueError):
                stream.flush()
        sys.stdout, sys.stderr = before


def _stream(like: Any, binary: io.BufferedWriter, by_line: bool = False) -> io.TextIOWrapper:
    if like is not None:
        like.flush()
    return io.TextIOWrapper(
        binary,
        encoding="utf-8" if like is None else like.encoding,
        errors="backslashreplace",
        line_buffering=by_line or (like is not None and like.line_buffering),
        write_through=like is not None and like.write_through,
    )


def _open_closed_descriptors() -> None:
    """Occupy descriptors 0 to 2 where they are closed: a results file could become stdout."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # The lowest free number is taken. Writing to a stdout that is read-only fails.
            os.open(os.devnull, os.O_WRONLY if number == 2 else os.O_RDONLY)
