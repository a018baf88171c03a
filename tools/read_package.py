"""``read_package.py WHEEL SDIST COMMIT``: look for what they have to hold, and nothing else."""

import re
import sys
import tarfile
import zipfile
from email import message_from_string
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def sources() -> set[str]:
    """Return what of the checkout belongs into a wheel."""
    found = {
        str(path.relative_to(ROOT))
        for folder in ("adhesis", "adhesis/solver", "adhesis/ensemble")  # the latter two are links
        for path in (ROOT / folder).rglob("*")
        if path.suffix in (".py", ".pyi", ".typed", ".mplstyle", ".css", ".html")
    }
    return found | {"adhesis/ensemble/commit.txt"}


def main(wheel: str, sdist: str, commit: str) -> None:
    """Compare; AssertionError with what is wrong."""
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        reported = archive.read("adhesis/ensemble/commit.txt").decode().strip()
        (metadata,) = (n for n in archive.namelist() if n.endswith(".dist-info/METADATA"))
        about = message_from_string(archive.read(metadata).decode())
    (kernels,) = (name for name in names if name.endswith(".so"))
    assert names - {kernels} == sources(), names ^ sources()
    assert reported == commit, reported
    text = str(about.get_payload())
    assert "# adhesis" in text
    assert not re.search(r"\]\((?!https?:)", text), "a link that leads nowhere"
    assert about["Author"] == "The adhesis developers"
    assert not about.get_all("Project-URL")
    required = [line for line in about.get_all("Requires-Dist") or [] if "extra" not in line]
    assert not any(line.startswith("mpi4py") for line in required)
    with tarfile.open(sdist) as archive:
        held = {name.split("/", 1)[1] for name in archive.getnames() if "/" in name}
    folder = ROOT / "adhesis" / "solver" / "kernels"
    sources_of_kernels = {str(path.relative_to(ROOT)) for path in folder.iterdir()}
    named = ("LICENSE", "CITATION.cff", "CHANGELOG.md", "CONTRIBUTING.md", "CMakeLists.txt")
    for name in (*sources(), *sources_of_kernels, *named):
        assert name in held, name
    for name in ("docs/theory.md", "tests/conftest.py", "jobs/paper.toml", "tools/setup.sh"):
        assert name in held, name
    assert not any(name.startswith(("study/", "benchmarks/")) for name in held)
    print(f"package: {len(names)} files in the wheel, {len(held)} in the source distribution")


if __name__ == "__main__":
    main(*sys.argv[1:])
