"""All gaps on one tree, for any number of them, and one implicit flow; not the default yet.

Import :class:`adhesis.solver.sharp.one_tree.tree_mechanics.TreeMechanics`.
"""
