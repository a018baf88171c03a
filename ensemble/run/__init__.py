"""Run a campaign: session, hand-out to ranks, lock, signals, progress.

Import from its modules; only :mod:`adhesis.ensemble.run.ranks` imports MPI.
"""
