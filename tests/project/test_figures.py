"""Every figure of the documentation is made by a command and says of which commit it is."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from pathlib import Path

from matplotlib.image import imread

ROOT = Path(__file__).resolve().parent.parent.parent


def load(name: str, path: str):
    spec = importlib.util.spec_from_file_location(name, ROOT / path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def kept() -> list[Path]:
    """Return the figures of docs/; what `make docs` leaves there is made anew each time."""
    site = {ROOT / "docs" / "_build", ROOT / "docs" / "gallery"}
    return sorted(p for p in (ROOT / "docs").rglob("*.png") if not site & set(p.parents))


def tool():
    return load("figures", "tools/figures_of_docs.py")


def test_every_figure_of_the_documentation_has_a_command():
    figures = tool()
    made = {path for part in figures.PARTS.values() for path in figures.figures(part)}
    assert made == set(kept())
    for part in figures.PARTS.values():
        for command in part.commands:
            modules = ("-m adhesis ", "-m tools.transcripts ")
            assert command.startswith(modules) or (ROOT / command.split()[0]).exists()


def test_a_stamp_is_read_again_and_leaves_the_picture_as_it_was(tmp_path):
    figures = tool()
    original = ROOT / "docs" / "figures" / "benchmark.png"
    path = tmp_path / "copy.png"
    shutil.copyfile(original, path)
    before = figures.stamped(path)
    for text in ("adhesis 1.0, commit abc", "adhesis 1.1, commit 12345"):
        figures.stamp(path, text)
        assert figures.stamped(path) == text != before
    assert path.read_bytes().count(b"tEXtSource") == 1
    assert (imread(path) == imread(original)).all()
