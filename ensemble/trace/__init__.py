"""Compute the loss of a measured trace: reading, preparation, plan, uncertainty, page.

:mod:`adhesis.ensemble.trace.trace_page` and its figures alone load matplotlib.
"""
