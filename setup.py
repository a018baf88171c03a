"""What pyproject.toml cannot say: the commit that is built, the README without its links."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

# Said before pip looks for packages, whose versions for an older Python fill a screen.
if sys.version_info < (3, 11):  # noqa: UP036  # pip runs this file before it checks the version
    sys.exit(
        "Python 3.11 or newer is needed, and this is Python "
        f"{sys.version_info[0]}.{sys.version_info[1]}: make .venv with a newer one, as in "
        "python3.12 -m venv .venv"
    )

ROOT = Path(__file__).resolve().parent


def commit() -> str:
    """Return the commit of this checkout, or the one that a source distribution was made from."""
    written = ROOT / "adhesis" / "ensemble" / "commit.txt"
    if not (ROOT / ".git").exists():
        return written.read_text().strip() if written.exists() else "unknown"
    done = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return done.stdout.strip() or "unknown"


def write_commit(folder: str) -> None:
    """Write the commit where :func:`adhesis.ensemble.versions.commit` looks for it."""
    path = Path(folder, "adhesis", "ensemble", "commit.txt")
    path.unlink(missing_ok=True)  # it may be a link to the checkout's
    path.write_text(commit() + "\n")


class Build(build_py):
    """Adds the commit to a wheel; an editable installation asks its checkout."""

    def run(self) -> None:
        """Build, then write."""
        super().run()
        if not self.editable_mode:
            write_commit(self.build_lib)


class Source(sdist):
    """Adds the commit to a source distribution."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        """Lay out, then write."""
        super().make_release_tree(base_dir, files)
        write_commit(base_dir)


def readme() -> str:
    """Return the README without images and links of the checkout, which lead nowhere elsewhere."""
    text = (ROOT / "README.md").read_text()
    text = re.sub(r"!\[[^]]*\]\((?!https?:)[^)]*\)\n\n\*[^*]*\*\n\n", "", text)
    text = re.sub(r"!\[[^]]*\]\((?!https?:)[^)]*\)\n?", "", text)
    return re.sub(r"\[([^]]+)\]\((?!https?:)[^)]*\)", r"\1", text)


setup(
    cmdclass={"build_py": Build, "sdist": Source},
    long_description=readme(),
    long_description_content_type="text/markdown",
)
