"""What the README tells a reader to do works."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from ensemble.command import run
from ensemble.run import launch

ROOT = Path(__file__).parent.parent.parent
README = (ROOT / "README.md").read_text()


def test_first_loop_runs() -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    match = re.fullmatch(r"([\d.]+) J/m² lost in (\d+) jumps \(([\d.]+) J/m²\)\n", done.stdout)
    assert match is not None, done.stdout
    assert float(match[1]) > 0
    assert abs(float(match[1]) / float(match[3]) - 1) < 0.01


def test_links_and_named_files_exist() -> None:
    links = re.findall(r"\]\(([^):]+)\)", README)
    files = re.findall(r"\b(?:jobs|docs)/[\w.-]+\.(?:sh|toml|md)", README)
    assert links
    for name in {*links, *files}:
        assert (ROOT / name).exists(), name


def test_make_targets_exist() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"(?:`|^    )make ([a-z]+)", README, re.MULTILINE)) <= targets


def test_exit_codes_are_those_of_run() -> None:
    told = {int(code) for code in re.findall(r"^\| (\d+) \|", README, re.MULTILINE)}
    assert launch.KILLED in told
    told.remove(launch.KILLED)
    assert told == {
        run.DONE,
        run.SOME_FAILED,
        run.BAD_INPUT,
        run.OUR_ERROR,
        run.WRITE_FAILED,
        run.RESUME,
    }
