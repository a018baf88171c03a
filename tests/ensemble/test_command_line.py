"""Check what all commands share: bad options, help, interrupts, full devices, several ranks."""

import argparse
import importlib
import math
import os
import shlex
import signal
import subprocess
import sys
import threading

import h5py
import pytest

from adhesis.ensemble.campaign.file import load_campaign
from adhesis.ensemble.command import main as command_line
from adhesis.ensemble.command.main import COMMANDS, main, parser_of
from adhesis.ensemble.errors import RankError
from adhesis.ensemble.quantities import Quantity
from adhesis.ensemble.results.layout import create
from tests.solver.test_bad_input import NUMBERS
from tests.support.campaign_support import environment, run_python, write_campaign
from tests.support.processes import ran
from tests.support.wrong_values import outside


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A campaign c.toml, a results file r.h5 without a row, a text, and a directory."""
    path = write_campaign(tmp_path)
    create(tmp_path / "r.h5", load_campaign(path))
    (tmp_path / "text").write_text("notes")
    (tmp_path / "directory").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(capsys, words) -> str:
    """Run a command with bad input in this process; returns its one sentence."""
    assert main(list(words)) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    return line


# Options of `adhesis loop` that are one number, with the rule that Python has too.
KNOWN = parser_of("loop")._option_string_actions
RULES = {f"--{name.replace('_', '-')}": bounds for name, (_, bounds) in NUMBERS.items()}
BOUNDED = {option: bounds for option, bounds in RULES.items() if option in KNOWN}


@pytest.mark.parametrize("option", BOUNDED)
def test_a_number_beyond_the_bounds_of_its_rule_is_refused(option, capsys, monkeypatch):
    monkeypatch.setattr("adhesis.ensemble.command.loop.run_loop", None)
    bounds = BOUNDED[option]
    words = ["loop", *([] if option == "--hurst" else ["--hurst=0.8"])]
    words += ["--stiffness=0"] if option == "--max-stress" else []
    unit = bounds.unit.partition(" ")[0].replace("²", "2")
    for number in outside(bounds):
        if bounds.whole and not float(number).is_integer():
            continue  # the parser refuses it: below
        given = f"{option}={number:.17g}{unit if math.isfinite(number) else ''}"
        line = refused(capsys, [*words, given])
        assert line.startswith(f"adhesis loop: {option} is "), line
        assert f": it must be {bounds.text}" in line


def test_an_option_that_chooses_tasks_may_be_repeated():
    many = parser_of("run").parse(["c.toml", "--hurst", "0.7", "--hurst", "0.8"])
    assert many.hurst == [0.7, 0.8]
    assert not [name for name in vars(many) if name.startswith("_")]


def test_an_error_that_is_of_no_single_option_names_none(monkeypatch, capsys):
    """Python 3.13 raises what older ones report through ``error``."""

    def parse_args(self, words, namespace):
        raise argparse.ArgumentError(None, f"unrecognized arguments: {' '.join(words[1:])}")

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse_args)
    line = refused(capsys, ["trace", "x.csv", "--speed"])
    assert line.startswith("adhesis trace: unrecognized arguments: --speed (")


def required(name: str) -> list[str]:
    words = []
    for action in parser_of(name)._actions:
        value = str(next(iter(action.choices))) if action.choices else "1"
        if action.option_strings and action.required:
            words += [action.option_strings[-1], value]
        elif not action.option_strings and action.nargs not in ("?", "*"):
            words.append(value)
    return words


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_refuses_what_it_cannot_read(name, capsys):
    assert "unrecognized arguments: --speed" in refused(capsys, [name, *required(name), "--speed"])
    for action in parser_of(name)._actions:
        if not action.option_strings or action.nargs == 0:
            continue
        option = action.option_strings[-1]
        assert f"{option}: a value is missing" in refused(capsys, [name, option])
        if action.choices is None:
            assert f"{option} is ''" in refused(capsys, [name, option, ""])
        if isinstance(getattr(action.type, "__self__", None), Quantity):
            for text in ("5 parsec", "5um5", "0,3nm"):
                assert f"{option} is {text!r}: it" in refused(capsys, [name, option, text])
        if action.choices is not None:
            assert f"{option} is 'x': it must be one of" in refused(capsys, [name, option, "x"])
        if action.type in (int, float):
            assert f"{option} is 'x': it must be a" in refused(capsys, [name, option, "x"])
        if action.type is int:
            many = "9" * 5000
            assert len(refused(capsys, [name, option, many])) < 250
            assert f"{option} is '1.5': it must be" in refused(capsys, [name, option, "1.5"])


@pytest.mark.parametrize("words", [["speed"], ["--vers"], ["Run"], ["stat"], ["-n", "3"]])
def test_an_unknown_command_is_refused_with_the_list(words, capsys):
    line = refused(capsys, words)
    assert line.startswith(f"adhesis: COMMAND is {words[0]!r}: it must be one of new, run, ")


@pytest.mark.parametrize("name", [*COMMANDS, ""])
def test_help_ends_with_two_examples_that_are_understood(name, capsys):
    assert main([*filter(None, [name]), "--help"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert shown[-3] == "examples:"
    for line in shown[-2:]:
        program, command, *words = shlex.split(line)
        assert (program, command) == ("adhesis", name or command)
        parser_of(command).parse(words)


def test_the_package_can_be_run():
    done = process("--version")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("adhesis 0.")


@pytest.mark.parametrize("name", [name for name in COMMANDS if name != "run"])
@pytest.mark.parametrize(
    ("number", "code", "word"),
    [
        (signal.SIGINT, 130, "interrupted"),
        (signal.SIGTERM, 143, "terminated"),
        (signal.SIGHUP, 143, "terminated"),
    ],
)
def test_signals_end_a_command_in_one_line(name, number, code, word, capsys, monkeypatch):
    module = importlib.import_module(f"adhesis.ensemble.command.{name}")
    monkeypatch.setattr(module, "execute", lambda args: signal.raise_signal(number))
    assert main([name, *required(name)]) == code
    assert capsys.readouterr().err == f"adhesis {name}: {word}\n"
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    assert signal.getsignal(signal.SIGHUP) == signal.SIG_DFL


def test_a_second_signal_does_not_cut_the_removal_of_unfinished_files_short(folder, monkeypatch):
    """A terminal that closes sends SIGHUP twice: the shell's, and the system's."""
    module = importlib.import_module("adhesis.ensemble.command.status")
    removed = []

    def execute(args):
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            signal.raise_signal(signal.SIGTERM)
            removed.append(True)

    monkeypatch.setattr(module, "execute", execute)
    assert main(["status", "r.h5"]) == 143
    assert removed == [True]


def test_what_nohup_ignores_does_not_end_a_command(folder, monkeypatch):
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    module = importlib.import_module("adhesis.ensemble.command.status")
    monkeypatch.setattr(module, "execute", lambda args: signal.raise_signal(signal.SIGHUP) or 0)
    try:
        assert main(["status", "r.h5"]) == 0
    finally:
        signal.signal(signal.SIGHUP, before)


FINDER = "import os, sys\nclass Finder:\n    def find_spec(name, *_):\n        "


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("module", ["adhesis.ensemble.command.main", "numpy"])
def test_a_signal_while_modules_are_loaded_ends_the_process_as_itself(module, number):
    """What a handler raises there may be lost, or come out as an ImportError."""
    code = (
        f"{FINDER}if name == {module!r}: os.kill(os.getpid(), {int(number)})\n"
        "from adhesis.__main__ import main\n"
        "sys.meta_path.insert(0, Finder)\n"
        "sys.argv[1:] = ['status', 'none.h5']\n"
        "sys.exit(main())\n"
    )
    done = run_python("-c", code)
    assert (done.returncode, done.stderr) == (-number, "")


def test_a_signal_while_modules_are_loaded_leaves_no_part_of_an_output(tmp_path):
    """Figures load modules while a report is written."""
    code = (
        f"{FINDER}os.kill(os.getpid(), {int(signal.SIGTERM)})\n"
        "from pathlib import Path\n"
        "from adhesis.ensemble.command import status\n"
        "from adhesis.ensemble.command.main import main\n"
        "from adhesis.ensemble.files import staged_folder, whole_file\n"
        "def execute(args):\n"
        "    with staged_folder(Path('.')) as staging, whole_file(Path('a.txt')):\n"
        "        (staging / 'figure.png').touch()\n"
        "        sys.meta_path.insert(0, Finder)\n"
        "        import colorsys\n"
        "status.execute = execute\n"
        "sys.exit(main(['status', 'r.h5']))\n"
    )
    done = ran(sys.executable, "-c", code, cwd=tmp_path, env=environment())
    assert (done.returncode, done.stderr) == (-signal.SIGTERM, "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_in_a_finalizer_ends_a_command(number, code, capsys, monkeypatch):
    """Python drops what is raised there; a command waits for ever where the signal is lost.

    It comes again, for the first time while the timer that sends it is still being started.
    """
    timers: list[threading.Timer] = []

    class Early(threading.Timer):
        def start(self):
            timers.append(self)
            if len(timers) == 1:
                signal.raise_signal(number)
            else:
                super().start()

    class Finalized:
        def __del__(self):
            signal.raise_signal(number)

    def execute(args):
        Finalized()
        threading.Event().wait(60)
        return 0

    monkeypatch.setattr("adhesis.ensemble.command.status.execute", execute)
    monkeypatch.setattr(threading, "Timer", Early)
    assert main(["status", "r.h5"]) == code
    assert "Traceback" not in capsys.readouterr().err
    assert len(timers) > 1  # more where what it raised was dropped once more


def test_watching_ends_with_ctrl_c_that_comes_inside_hdf5(folder, capsys, monkeypatch):
    """There what a handler raises would come out as an error of the file."""
    iterate, signals = h5py.h5ds.iterate, [signal.SIGINT]

    def interrupted(dataset, dim, function, start):
        def take(scale):
            if signals:
                signal.raise_signal(signals.pop())
            function(scale)

        return iterate(dataset, dim, take, start)

    monkeypatch.setattr(h5py.h5ds, "iterate", interrupted)
    assert main(["status", "r.h5", "--watch"]) == 130
    assert capsys.readouterr().err == "adhesis status: interrupted\n"


def process(*words, before="", **options) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own, by a shell where something stands before it."""
    shell = ["sh", "-c", f'"$@" {before}', "sh"] if before else []
    command = [*shell, sys.executable, "-m", "adhesis", *words]
    return ran(*command, **({"env": environment()} | options))


def test_a_full_device_or_a_closed_stdout_is_one_sentence(folder):
    with open("/dev/full", "w") as full:
        done = process("--help", stdout=full), process("status", "r.h5", stdout=full)
    full, closed = "No space left on device", "Bad file descriptor"
    cases = (("", full), (" status", full), ("", closed))
    for ended, (name, why) in zip((*done, process("--help", before=">&-")), cases, strict=True):
        sentence = f"adhesis{name}: stdout could not be written: {why}\n"
        assert (ended.returncode, ended.stderr) == (74, sentence)


def test_messages_that_cannot_be_written_change_nothing(folder):
    with open("/dev/full", "w") as full:
        assert process("status", "--speed", stderr=full).returncode == 2
    assert process("status", "--speed", before="2>&-").returncode == 2


def test_a_setting_of_windows_does_not_reach_figures(tmp_path):
    words = ("loop", "--hurst", "0.8", "--n0", "2", "--ratio", "4", "--load-steps", "2")
    env = environment() | {"MPLBACKEND": "nosuch"}
    done = process(*words, "--figure", tmp_path / "a.png", "--quiet", env=env)
    assert done.returncode == 0, done.stderr


def test_a_reader_that_leaves_ends_the_command_without_a_word():
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "w") as pipe:
        done = process("--help", stdout=pipe)
    assert (done.returncode, done.stderr) == (1, "")


def test_an_ascii_terminal_shows_what_it_can():
    done = process("loop", "--help", env=environment() | {"PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stderr) == (0, "")
    assert "J/m\\xb2" in done.stdout


@pytest.fixture
def rank_one(monkeypatch):
    """Make this process rank 1 of 3; returns the times that it waited for rank 0."""
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "3")
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    waited: list[float] = []
    monkeypatch.setattr(command_line.time, "sleep", waited.append)
    return waited


def test_rank_0_alone_reports_and_runs(rank_one, capsys):
    for words in (["run", "c.toml", "--speed"], ["speed"], ["status", "none.h5"], ["--version"]):
        assert main(words) == 0
    printed = capsys.readouterr()
    assert (printed.out, printed.err, rank_one) == ("", "", [])


def test_an_error_of_one_rank_is_reported_when_rank_0_had_its_time(rank_one, capsys, monkeypatch):
    assert main(["loop", "--hurst", "x"]) == 2  # loops of a launcher are independent
    assert len(rank_one) == 1
    assert "--hurst is 'x'" in capsys.readouterr().err

    def fail(args):
        raise RankError("no mpi4py here")

    monkeypatch.setattr("adhesis.ensemble.command.run.execute", fail)
    assert main(["run", "c.toml"]) == 2
    assert len(rank_one) == 2
    assert capsys.readouterr().err == "adhesis run: no mpi4py here\n"


@pytest.mark.parametrize("name", COMMANDS)
def test_no_option_can_be_abbreviated(name, capsys):
    """What passes options on, as the batch scripts do, knows them by their whole names."""
    parser = parser_of(name)
    words, options = required(name), set(parser._option_string_actions)
    parser.parse(words)
    short = {o[:end] for o in options if len(o) > 3 for end in (3, len(o) - 1)} - options
    assert short
    for option in sorted(short):
        for given in ([option, "1"], [f"{option}=1"]):
            assert given[0] in refused(capsys, [name, *words, *given])
