"""Programs that are run to their end, and scripts in the place of programs."""

import subprocess
from pathlib import Path
from typing import Any


def ran(*words: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a program to its end; its exit code is for the caller to judge."""
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "timeout": 150}
    return subprocess.run([str(word) for word in words], **given | options)


def executable(path: Path, text: str) -> Path:
    """Write a script, in a folder that may be new."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)
    return path
