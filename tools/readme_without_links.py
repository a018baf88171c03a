"""The README of the package: without images and links of the checkout, dead ends elsewhere."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent


def readme() -> str:
    """Return the text."""
    text = (ROOT / "README.md").read_text()
    text = re.sub(r"!\[[^]]*\]\((?!https?:)[^)]*\)(\n\n\*[^*]*\*\n\n|\n?)", "", text)
    return re.sub(r"\[([^]]+)\]\((?!https?:)[^)]*\)", r"\1", text)


def dynamic_metadata(settings: Mapping[str, Any], project: Mapping[str, Any]) -> dict[str, Any]:
    """Return the field ``readme`` of pyproject.toml, for the build backend."""
    return {"readme": {"content-type": "text/markdown", "text": readme()}}
