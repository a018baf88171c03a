"""The test suite. Importing it restricts linear algebra to one thread, in all its processes.

On a busy machine threads of small matrices wait for one another: one module took 50 times as long.
This comes before numpy is loaded.
"""

import os

from ensemble.run.launch import ONE_THREAD

for _variable, _count in ONE_THREAD.items():
    os.environ.setdefault(_variable, _count)
