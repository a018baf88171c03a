"""The edges of one problem: law, tolerances, and the linear response that is kept.

Import :class:`adhesis.solver.sharp.mechanics.EdgeMechanics`, which solves and moves them.
"""
