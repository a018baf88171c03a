"""Method ``sharp``: real-valued contact edges, followed along branches and through jumps.

Import ``method.SharpMethod``; the other modules are its parts.
"""
