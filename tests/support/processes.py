"""Programs that are run to their end."""

import subprocess
from typing import Any


def ran(*words: object, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run a program to its end; its exit code is for the caller to judge."""
    given = {"capture_output": True, "text": True, "timeout": 150, "check": False}
    return subprocess.run([str(word) for word in words], **given | options)
