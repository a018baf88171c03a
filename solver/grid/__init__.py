"""Method ``grid``: contact sets of equally spaced nodes, moved by energy comparison.

Import ``method.GridMethod``; the other modules are its parts.
"""
