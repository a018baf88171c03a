"""The commands on campaigns: their files, runs, results and reports.

Import a module of this folder for the command of its name; :mod:`adhesis.ensemble.command.main`
calls them.
"""
