"""The methods judged by the closed forms: claims of (quantity, error, bound).

Import ``claims.validate``; ``judge``
measures the errors.
"""
