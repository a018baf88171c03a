"""The documentation site: what it has to hold, and that its examples run. `make docs` makes it."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]_*.py"))


def test_every_page_is_in_the_contents() -> None:
    index = (ROOT / "docs" / "index.md").read_text()
    pages = {
        str(path.relative_to(ROOT / "docs").with_suffix(""))
        for path in (ROOT / "docs").rglob("*.*")
        if path.suffix in (".md", ".rst") and not {"_build", "gallery"} & set(path.parts)
    }
    left_out = {"index", *(p for p in pages if p.endswith("README"))}
    assert pages - left_out - set(re.split(r"[\s<>]+", index)) == set()


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
