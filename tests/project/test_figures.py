"""Every figure of the documentation is made by a command and says of which commit it is."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
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


def test_a_figure_that_is_no_longer_made_is_removed(tmp_path, monkeypatch):
    figures = tool()
    folder = tmp_path / "docs" / "paper"
    folder.mkdir(parents=True)
    for name in ("fig4.png", "fig5.png"):
        shutil.copyfile(ROOT / "docs" / "figures" / "loop.png", folder / name)
    (tmp_path / "draw.py").write_text(
        "import shutil, sys; shutil.copyfile('docs/paper/fig5.png', sys.argv[1])\n"
        "open(sys.argv[1].replace('png', 'csv'), 'w').close()"
    )
    (tmp_path / "numbers").mkdir()
    monkeypatch.setattr(figures, "ROOT", tmp_path)
    part = figures.Part(("draw.py OUT/fig5a.png",), "*.*", "paper", data="numbers")
    monkeypatch.setattr(figures, "PARTS", {"paper": part})
    figures.make("paper", 1)
    assert [path.name for path in folder.iterdir()] == ["fig5a.png"]
    assert figures.stamped(folder / "fig5a.png").endswith("ARGS=paper")
    assert [path.name for path in (tmp_path / "numbers").iterdir()] == ["fig5a.csv"]


@pytest.mark.parametrize("path", kept(), ids=lambda path: path.stem)
def test_figures_have_a_white_ground_so_that_a_dark_page_shows_them(path):
    image = imread(path)
    edge = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    assert (image[..., 3:] == 1).all()
    assert np.median(edge[:, :3]) == 1
