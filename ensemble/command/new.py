"""Write a commented campaign file that runs as it is, as a start for one of your own.

It lists every key with its meaning, its rule and its default. An existing file is not overwritten.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from adhesis.ensemble.escape import shell_word
from adhesis.ensemble.outputs import check_ending, write_new

EXAMPLES = ("adhesis new my.toml", "adhesis new study/first.toml")


OPTIONS = (("file FILE.toml", Path, "the file to write"),)


def execute(args: argparse.Namespace) -> None:
    """Write the file."""
    check_ending("FILE.toml", args.file, ".toml")

    def content() -> bytes:
        from adhesis.ensemble.campaign.template import campaign_template  # loads numpy

        return campaign_template().encode()

    write_new("FILE.toml", args.file, content)
    file = shell_word(args.file)
    print(f"next        adhesis run {file} --dry-run   (its cost; without --dry-run: the run)")
