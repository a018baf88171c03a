"""The figures of the report, each drawn from an aggregate; their style.

Import from its modules; :mod:`adhesis.ensemble.report.figures.catalogue` lists what each figure
shows.
"""
