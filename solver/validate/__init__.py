"""The methods judged by the closed forms: claims of (quantity, error, bound).

Import :func:`adhesis.solver.validate.claims.validate`; :mod:`adhesis.solver.validate.judge`
measures the errors.
"""
