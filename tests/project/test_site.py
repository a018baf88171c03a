"""The examples of the documentation site run. `make docs` makes it, and finds what it lacks."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]_*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run(path, monkeypatch, capsys):
    """Each says something and draws something."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    monkeypatch.setattr(plt, "show", lambda: None)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    runpy.run_path(str(path))
    figures = plt.get_fignums()
    plt.close("all")
    assert figures
    assert capsys.readouterr().out
