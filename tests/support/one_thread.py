"""Restrict linear algebra to one thread, in all processes of the tests, before numpy is loaded.

Threads for small matrices wait for one another on a busy machine: one module took 50 times as long.
"""

import os

from adhesis.ensemble.run.launch import ONE_THREAD

for _variable, _count in ONE_THREAD.items():
    os.environ.setdefault(_variable, _count)
