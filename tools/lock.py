"""Write the two lists of versions from the environment that runs this.

    python tools/lock.py

``requirements.lock``: all that adhesis needs to run, and to build h5py. ``requirements-test.lock``:
what tests, linters and the optional formats of instruments need besides.
"""

import re
import tomllib
from collections.abc import Iterable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parent.parent
# What h5py and the kernels are built with, without isolation.
BUILD = (
    *("setuptools", "Cython", "pkgconfig", "packaging"),
    *("scikit_build_core", "nanobind", "cmake", "ninja"),
)
TEST_EXTRAS = ("dev", "instruments")


def closure(names: Iterable[str]) -> dict[str, str]:
    """Versions of packages and of all that they need here, by their names in lower case."""
    found: dict[str, str] = {}
    open_names = list(names)
    while open_names:
        asked = Requirement(open_names.pop())
        key = re.sub(r"[-_.]+", "-", asked.name).lower()
        package = distribution(asked.name)
        extras = asked.extras or {""}
        wanted = [
            str(other)
            for other in map(Requirement, package.requires or ())
            if other.marker is None or any(other.marker.evaluate({"extra": e}) for e in extras)
        ]
        if key in found and not asked.extras:
            continue
        found[key] = f"{package.metadata['Name']}=={package.version}"
        open_names += wanted
    return found


def write(path: Path, versions: dict[str, str]) -> None:
    """Replace the lines of a list, keeping what its head says."""
    head = [line for line in path.read_text().splitlines() if line.startswith("#")]
    path.write_text("\n".join([*head, *(versions[key] for key in sorted(versions))]) + "\n")


def main() -> None:
    """Write both."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    runs = closure([*project["dependencies"], *extras["mpi"], *BUILD])
    # set-up installs a compiler only where the system has none: else its version stays
    if listed := re.search(r"^ziglang==.*$", (ROOT / "requirements.lock").read_text(), re.M):
        runs["ziglang"] = listed[0]
    with suppress(PackageNotFoundError):
        runs |= closure(["ziglang"])
    tests = closure([text for name in TEST_EXTRAS for text in extras[name]])
    write(ROOT / "requirements.lock", runs)
    write(ROOT / "requirements-test.lock", {k: v for k, v in tests.items() if k not in runs})


if __name__ == "__main__":
    main()
