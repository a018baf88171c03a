"""Figures that are drawn, but not laid out and written, which takes seconds for each."""

import base64
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

DOT = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


def figures_of(data: Any, *names: str) -> list[Any]:
    """Draw figures of a report by their names, and no others."""
    from adhesis.ensemble.report.figures import catalogue, style  # loads matplotlib

    items = {item.name: item for part in catalogue.sections(data).values() for item in part}
    with style.style():
        return [items[name].of(data) for name in names]


@contextmanager
def few_figures(*written: str) -> Iterator[dict[str, Any]]:
    """Collect figures by name; those that are not ``written`` are pictures of their names."""
    from adhesis.ensemble.report.figures import style  # loads matplotlib

    figures, save = {}, style.save

    def keep(figure: Any, stem: Path) -> tuple[Path, Path]:
        figures[stem.name] = figure
        if stem.name in written:
            return save(figure, stem)
        paths = stem.with_suffix(".png"), stem.with_suffix(".pdf")
        for path in paths:
            path.write_bytes(DOT + stem.name.encode())
        return paths

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "save", keep)
        yield figures
