"""The package: what says who, what and how to cite; the wheel in a bare environment."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import adhesis
from tools.readme_without_links import readme

ROOT = Path(__file__).resolve().parent.parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_versions_agree() -> None:
    citation = (ROOT / "CITATION.cff").read_text()
    reported = dict(re.findall(r"^([a-z-]+): (.+)$", citation, re.MULTILINE))
    assert (reported["version"], reported["license"]) == (PROJECT["version"], PROJECT["license"])
    assert re.search(r'volume: 92\n    start: "062404"', citation)
    assert "value: arXiv:1511.08891" in citation
    assert adhesis.__version__ == PROJECT["version"]
    heads = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert heads[0] == PROJECT["version"]


def test_the_readme_of_the_package_has_no_link_into_the_checkout() -> None:
    text = readme()
    assert text.startswith("# adhesis")
    assert len(text) > 0.8 * len((ROOT / "README.md").read_text())
    assert re.findall(r"\]\((?!https?:)", text) == []


@pytest.mark.slow(reason="installs everything anew and compiles once more")
def test_the_wheel_works_in_a_bare_environment() -> None:
    done = subprocess.run(
        [ROOT / "tools" / "check_package.sh"],
        env={"PATH": "/usr/bin:/bin", "PYTHON": sys.executable},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "package: good" in done.stdout
