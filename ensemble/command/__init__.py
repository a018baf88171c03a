"""The command line: one module a command, and :mod:`adhesis.ensemble.command.main` that calls them.

Import :func:`adhesis.ensemble.command.main.main`; a command module offers ``add_arguments(parser)``
and ``execute(args) -> int`` (the exit code), and its docstring's first line is its help.
"""
