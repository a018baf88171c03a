"""Method ``zones``: Dugdale's law, with zones whose ends lie between the nodes of a grid.

Import ``method.ZonesMethod``; the other modules are its parts.
"""
