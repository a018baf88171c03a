"""A run of a campaign: one session, hand-out to ranks, lock, signals, progress.

Import from its modules; :mod:`adhesis.ensemble.run.ranks` is the door to MPI.
"""
