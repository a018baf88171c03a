"""Compute the loss of a measured trace: reading, preparation, plan, uncertainty, page.

Import :mod:`adhesis.ensemble.trace.reading.measured_trace`, :mod:`adhesis.ensemble.trace.prepare`,
:mod:`adhesis.ensemble.trace.answer` and :mod:`adhesis.ensemble.trace.trace_page`; the last one
alone loads matplotlib.
"""
