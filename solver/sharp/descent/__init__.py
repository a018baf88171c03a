"""Descent in energy after a loss of stability: the gradient flow of the edges.

Import from its modules.
"""
