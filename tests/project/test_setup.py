"""Set-up, launch scripts and packaging: what can be checked without installing anything."""

import ast
import fcntl
import importlib.metadata
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.project.test_package import PROJECT
from tests.support.campaign_support import ROOT, has_ended, started, wait_until
from tests.support.processes import executable, ran

# Distribution names that differ from what is imported, and what other packages need to find.
IMPORTED_AS = {"markdown-it-py": "markdown_it", "surfacetopography": "SurfaceTopography"}
LOADED_BY_NAME = {"h5netcdf"}  # xarray's engine


def locked(name: str = "requirements.lock") -> dict[str, str]:
    lines = (ROOT / name).read_text().splitlines()
    pairs = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {name.lower().replace("_", "-"): version for name, version in pairs}


def test_dependencies_are_what_is_imported() -> None:
    files = (f for name in ("solver", "ensemble") for f in (ROOT / "adhesis" / name).rglob("*.py"))
    nodes = [node for file in files for node in ast.walk(ast.parse(file.read_text()))]
    modules = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    modules += [str(n.module) for n in nodes if isinstance(n, ast.ImportFrom) and not n.level]
    imported = {name.split(".")[0] for name in modules} - {*sys.stdlib_module_names, "adhesis"}
    extras = PROJECT["optional-dependencies"]
    needed = [*PROJECT["dependencies"], *extras["mpi"], *extras["instruments"]]
    declared = {Requirement(text).name.lower() for text in needed}
    assert imported | LOADED_BY_NAME == {IMPORTED_AS.get(name, name) for name in declared}


def test_lists_of_versions_leave_nothing_to_resolve() -> None:
    """Set-up installs them without asking what else they need: also a compiler, where none is."""
    assert "ziglang" in locked()
    for lists in (["requirements.lock"], ["requirements.lock", "requirements-test.lock"]):
        listed = {name: version for file in lists for name, version in locked(file).items()}
        for name in listed.keys() - {"ziglang"}:  # needs nothing, and is not installed beside c++
            for text in importlib.metadata.requires(name) or ():
                other = Requirement(text)
                if other.marker is None or other.marker.evaluate({"extra": ""}):
                    key = re.sub(r"[-_.]+", "-", other.name).lower()
                    assert key in listed, f"{name} needs {other}"
                    assert listed[key] in other.specifier, f"{name} needs {other}"


def test_set_up_changes_nothing_when_nothing_has_changed() -> None:
    stamp = Path(sys.prefix, "adhesis-setup")
    # Through a link to the .venv of another checkout it would be set up for this one.
    if not stamp.exists() or Path(sys.prefix).resolve().parent != ROOT:
        pytest.skip("these tests do not run in a .venv that tools/setup.sh made for this checkout")
    before = stamp.stat().st_mtime_ns
    env = {k: v for k, v in os.environ.items() if k not in ("VIRTUAL_ENV", "PYTHONHOME")}
    done = ran(ROOT / "tools" / "setup.sh", env=env, check=True, timeout=None)
    assert "nothing to do" in done.stdout
    assert stamp.stat().st_mtime_ns == before


def copied(folder: Path) -> Path:
    """Copy what set-up needs; returns its script."""
    shutil.copytree(ROOT / "tools", folder / "tools")
    for name in ("pyproject.toml", "requirements.lock", "requirements-test.lock"):
        shutil.copy(ROOT / name, folder)
    return folder / "tools" / "setup.sh"


def test_an_older_python_is_named_before_anything_is_installed(tmp_path: Path) -> None:
    """By set-up; pip refuses it by requires-python."""
    text = '#!/bin/sh\n[ "$1" = -V ] && echo Python 3.10.13 && exit 0\nexit 1\n'
    old = executable(tmp_path / "python3.10", text)
    done = ran(copied(tmp_path), env=os.environ | {"PYTHON": str(old)}, timeout=None)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == (
        f"setup: failed: Python 3.11 or newer is needed, and {old} is Python 3.10.13 (say which "
        "with PYTHON=…)\n"
    )


def test_a_second_set_up_waits_for_the_first(tmp_path: Path) -> None:
    """Both would install into one .venv."""
    if shutil.which("flock") is None:
        pytest.skip("flock is missing here, without which set-up does not wait")
    setup = copied(tmp_path)
    (tmp_path / ".setup").mkdir()
    env = os.environ | {"PYTHON": "/bin/false"}  # where it would end at once
    with (tmp_path / ".setup" / "lock").open("w") as first:
        fcntl.flock(first, fcntl.LOCK_EX)
        second = subprocess.Popen(
            [setup], env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        line = second.stdout.readline()
        assert line == "setup: another set-up is at work in this folder: waiting for its end\n"
        assert second.poll() is None
    _, errors = second.communicate(timeout=20)
    assert second.returncode == 1
    assert "Python 3.11 or newer is needed" in errors


def test_a_part_of_set_up_that_fails_is_told_and_none_is_left_behind(tmp_path: Path) -> None:
    script = f"""
        set -eu
        say() {{ printf 'setup: %s\\n' "$*"; }}
        log='{tmp_path}/log' TELL_EVERY=1
        . '{ROOT}/tools/parts.sh'
        trap end_parts EXIT
        long() {{ sleep 50 & echo $! >child; wait; }}
        fail() {{ until [ -s child ]; do sleep 0.05; done; return 3; }}
        part long "what goes on" long
        part fails "what fails" fail
        finish fails || exit $?
    """
    done = ran("bash", "-c", script, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (3, "")
    assert re.fullmatch(r"setup: what fails: \d+ s, failed", done.stdout.splitlines()[-1])
    child = int((tmp_path / "child").read_text())
    wait_until(lambda: has_ended(child), 20)  # by itself it would end later


def test_local_script_asks_for_a_campaign() -> None:
    done = ran(ROOT / "jobs" / "local.sh", timeout=None)
    assert done.returncode != 0
    assert "usage: jobs/local.sh CAMPAIGN.toml" in done.stderr


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_local_script_stops_its_run_in_order(tmp_path: Path, number: signal.Signals) -> None:
    # A checkout in which adhesis is a stand-in that notes how it is stopped.
    for folder in ("jobs", "tools"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    stand_in = "#!/bin/bash\ntrap 'exit 75' USR1\nsleep 60 & touch begun\nwait\n"
    executable(tmp_path / ".venv" / "bin" / "adhesis", stand_in)
    script = started([tmp_path / "jobs" / "local.sh", "study.toml", "1"], tmp_path)
    try:
        wait_until((tmp_path / "begun").exists)
        script.send_signal(number)
        assert script.wait(20) == 75
        assert "the same command resumes it (out/study.h5)" in script.stderr.readline()
    finally:
        os.killpg(script.pid, signal.SIGKILL)  # the stand-in's sleep


def test_modules_are_not_searched_for_above_the_checkout() -> None:
    """A file of the user there, beside the clone, would be taken for a library."""
    code = "import sys; print(*sys.path, sep='\\n')"
    searched = ran(sys.executable, "-I", "-c", code, check=True).stdout.splitlines()
    assert searched
    assert str(ROOT.parent) not in searched
