"""A measured trace to its loss: reading, preparation, plan, answer with its uncertainty, page.

Import :mod:`ensemble.trace.read`, :mod:`ensemble.trace.prepare`, :mod:`ensemble.trace.answer` and
:mod:`ensemble.trace.page`; the last one alone loads matplotlib.
"""
