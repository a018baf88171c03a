"""Validate the methods against closed forms: claims of (quantity, error, bound).

Import ``claims.validate``; ``judge`` measures the errors.
"""
