"""Record how a JSON document came about: program, command, input, seed and units."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from adhesis.ensemble.quantities import units_of
from adhesis.ensemble.regular_file import open_regular
from adhesis.ensemble.versions import software


def input_record(path: Path | None) -> dict[str, Any] | None:
    """Return name, size and checksum of an input file; None for none."""
    if path is None:
        return None
    with open_regular(path) as file:
        checksum = hashlib.file_digest(file, "sha256").hexdigest()
        return {"file": str(path), "bytes": file.tell(), "sha256": checksum}


def provenance(
    words: Sequence[str],
    source: Mapping[str, Any] | None,
    seed: int | None,
    document: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the entry ``provenance`` of a document.

    ``words`` are command and options as they were given, ``source`` is the :func:`input_record`,
    and ``seed`` that of a random profile.
    """
    return {
        **software(),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": shlex.join(["adhesis", *words]),
        "input": source,
        "seed": seed,
        "units": units_of(document),
    }
