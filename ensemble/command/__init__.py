"""The command line: a module a command, with ``EXAMPLES``, ``add_arguments`` and ``execute``.

Its docstring's first line is its help; :mod:`adhesis.ensemble.command.main` calls them.
"""
