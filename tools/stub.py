"""Write the types of the kernels, from the module that was built, for mypy and editors.

python tools/stub.py
"""

import re
from pathlib import Path

from nanobind.stubgen import StubGen

from adhesis.solver import _kernels

PATH = Path(__file__).resolve().parent.parent / "adhesis" / "solver" / "_kernels.pyi"


def stub() -> str:
    """Return the types of the module: of arrays those of their numbers, of constants alone."""
    generator = StubGen(_kernels, include_docstrings=False)
    generator.put(_kernels)
    text = re.sub(r"^([A-Z_]+: \w+) = .*$", r"\1", generator.get(), flags=re.MULTILINE)
    return re.sub(r"Annotated\[(NDArray\[[a-z0-9.]+\]), dict\([^)]*\)\]", r"\1", text)


if __name__ == "__main__":
    PATH.write_text(stub())
