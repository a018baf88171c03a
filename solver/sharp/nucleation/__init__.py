"""Nucleation of contact inside a gap."""
