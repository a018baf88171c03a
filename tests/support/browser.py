"""Pages opened in a browser, which runs their scripts."""

import html
import json
import os
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.support.processes import ran

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
BROWSER = next(filter(None, map(shutil.which, NAMES)), None)
needs_browser = pytest.mark.skipif(
    BROWSER is None,
    reason="no Chromium in PATH: the page is not opened (Debian: make test, as root)",
)


def seen_by_browser(page: str, script: str, folder: Path) -> Any:
    """Return what a script at the end of a page hands to ``reportSeen``, as soon as it does."""
    begin = "const reportSeen = found => { document.getElementById('seen').textContent = "
    probe = (
        f"<pre id='seen'></pre><script>{begin}JSON.stringify(found); }};{script}</script></body>"
    )
    path = folder / "page.html"
    path.write_text(page.replace("</body>", probe), encoding="utf-8")
    sandbox = [] if os.geteuid() else ["--no-sandbox"]  # Chromium has none for root
    done = ran(
        *(BROWSER, "--headless", *sandbox, "--disable-gpu", f"--user-data-dir={folder}/user"),
        *("--virtual-time-budget=120000", "--dump-dom", path.as_uri()),
        check=True,
        timeout=None,
    )
    found = re.search(r"<pre id=['\"]seen['\"]>(.*?)</pre>", done.stdout, re.DOTALL)
    assert found[1]
    return json.loads(html.unescape(found[1]))
