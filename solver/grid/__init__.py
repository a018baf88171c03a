"""Method ``grid``: contact sets of equally spaced nodes, moved by energy comparison.

Import :class:`adhesis.solver.grid.method.GridMethod`; the other modules are its parts.
"""
