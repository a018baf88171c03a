"""Equilibrium of the contact edges by Griffith's condition: Newton's iteration, stability, rates.

Import from its modules.
"""
