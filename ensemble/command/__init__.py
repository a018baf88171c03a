"""The command line: a module a command, with ``EXAMPLES``, ``OPTIONS`` and ``execute``.

Its docstring's first line is its help. ``execute`` returns an exit code, or None for 0;
:mod:`adhesis.ensemble.command.main` calls it.
"""
