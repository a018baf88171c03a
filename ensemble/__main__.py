"""``python -m ensemble COMMAND …``: the command line, where no script is installed."""

import sys

from ensemble.command import main

sys.exit(main())
