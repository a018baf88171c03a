"""The methods judged by the closed forms: claims of (quantity, error, bound).

Import :func:`solver.validate.claims.validate`; :mod:`solver.validate.judge` measures the errors.
"""
