"""A measured trace to its loss: reading, preparation, plan, answer with its uncertainty, page.

Import :mod:`adhesis.ensemble.trace.read`, :mod:`adhesis.ensemble.trace.prepare`,
:mod:`adhesis.ensemble.trace.answer` and :mod:`adhesis.ensemble.trace.page`; the last one alone
loads matplotlib.
"""
