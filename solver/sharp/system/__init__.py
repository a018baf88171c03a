"""The edges of one problem: law, tolerances, and the linear responses that are kept.

Import :class:`adhesis.solver.sharp.mechanics.EdgeMechanics`, which solves and moves them.
"""
