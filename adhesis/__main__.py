"""``python -m adhesis COMMAND …``, and the script ``adhesis``: the command line."""

from __future__ import annotations

import signal
import sys


def main() -> int:
    """Run the command of the command line; returns its exit code."""
    # What Python raises at Ctrl-C while modules are loaded is shown as an error, or lost: until
    # there is a handler the signal ends the process itself.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from adhesis.ensemble.command.main import main

    return main()


if __name__ == "__main__":
    sys.exit(main())
