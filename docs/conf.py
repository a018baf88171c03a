"""The documentation site, made by `make docs` from these pages, the docstrings and examples/."""

from __future__ import annotations

import contextlib
import re
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import adhesis

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tools import transcripts  # noqa: E402  # needs the path

project = "adhesis"
author = copyright = "The adhesis developers"
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build"]  # of an earlier site, with the pages that it hands out
language = "en"
smartquotes = False  # options begin with two hyphens

# Anchors as the pages use them where they are read as plain Markdown.
myst_heading_anchors = 4

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say types, with shapes and units
napoleon_numpy_docstring = True
napoleon_use_ivar = True
napoleon_use_rtype = False

html_theme = "furo"
html_title = "adhesis"
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {"navigation_with_keys": True}
html_css_files = ["adhesis.css"]
html_static_path = ["static"]

sphinx_gallery_conf = {
    "examples_dirs": str(ROOT / "examples"),
    "gallery_dirs": "gallery",
    "filename_pattern": r"/\d_",
    "ignore_pattern": r"(^|/)(?!\d_)[^/]*\.py$",  # programs with options of their own
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "min_reported_time": 0,
    "image_scrapers": ("matplotlib",),
    "matplotlib_animations": False,
    "capture_repr": (),
    "write_computation_times": False,
}

# A docstring's home is the module that defines it; the pages describe it as a name of `adhesis`.
PUBLIC = {f"{getattr(adhesis, n).__module__}.{n}": f"adhesis.{n}" for n in adhesis.__all__}


def plain(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Take signs of formulas (E*, |a_m|²) for what they are, and pages of docs/ for links."""
    for place, line in enumerate(lines):
        parts = re.split(r"(``[^`]*``|:\w+:`[^`]*`)", line)
        parts[::2] = [re.sub(r"([*|])", r"\\\1", part) for part in parts[::2]]
        line = "".join(parts)
        lines[place] = re.sub(r"docs/([\w-]+)\.md", r":doc:`\1`", line)


def start_page(app: Any, name: str, source: list[str]) -> None:
    """Lead to the start page, which holds the README, and hand out files beside the pages."""
    source[0] = source[0].replace("](../README.md", "](index.md")
    source[0] = source[0].replace("](../study/", "](path:../study/")


def public_name(app: Any, env: Any, node: Any, content: Any) -> Any:
    """Resolve `adhesis.solver.….LoopResult` to the entry of `adhesis.LoopResult`."""
    wanted = PUBLIC.get(node.get("reftarget", ""))
    if wanted is None:
        return None
    domain = env.domains["py"]
    return domain.resolve_xref(
        env, node["refdoc"], app.builder, node["reftype"], wanted, node, content
    )


def films(app: Any, error: Exception | None) -> None:
    """Write the films of docs/python.md and docs/tutorial.md beside their pages.

    The second is made by the tutorial itself, whose outputs are compared with the page.
    """
    if error is not None or app.builder.format != "html":
        return
    profile = adhesis.self_affine_profile(0.8, period=2e-3, n0=2, ratio=12, seed=3, h_rms=1e-6)
    problem = adhesis.Problem(profile, adhesis.HalfSpace(1e6, 0.5), 0.02)
    method = adhesis.make_method("auto", problem)
    loop = adhesis.run_loop(method, max_penetration=0.8, load_steps=20)
    loop.film(Path(app.outdir, "film.html"), frames=60)
    page = ROOT / "docs" / "tutorial.md"
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        wrong = transcripts.wrong(page, transcripts.lesson(page))
        if wrong:
            raise RuntimeError("\n".join(wrong))
        shutil.copyfile("first_film.html", Path(app.outdir, "first_film.html"))


def setup(app: Any) -> None:
    """Connect them."""
    app.connect("build-finished", films)
    app.connect("source-read", start_page)
    app.connect("autodoc-process-docstring", plain, priority=400)  # ahead of napoleon
    app.connect("missing-reference", public_name)
