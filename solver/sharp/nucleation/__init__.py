"""Nucleation of contact inside a gap, and of a crack inside a patch."""
