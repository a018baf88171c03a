"""Systems of edges: their field, equilibrium and descent, for few gaps or for many.

Import :class:`adhesis.solver.sharp.mechanics.EdgeMechanics`, which chooses between them.
"""
