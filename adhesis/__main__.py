"""``python -m adhesis COMMAND …``: the command line, where no script is installed."""

import sys

from adhesis.ensemble.command.main import main

sys.exit(main())
