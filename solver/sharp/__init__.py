"""Method ``sharp``: real-valued contact edges, followed along branches and through jumps.

Import :class:`adhesis.solver.sharp.method.SharpMethod`; the other modules are its parts.
"""
