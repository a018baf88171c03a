"""One gap: its ends, conformal map, quadrature, full-contact stress and moments.

Import from its modules.
"""
