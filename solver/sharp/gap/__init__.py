"""Ends, conformal map, quadrature, full-contact stress and moments of a gap.

Import from its modules.
"""
