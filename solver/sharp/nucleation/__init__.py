"""Nucleation of contact where surfaces touch inside a gap.

Import from its modules.
"""
