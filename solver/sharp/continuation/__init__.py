"""Continuation of stable branches: predictor, corrector, events, jumps.

Import from its modules.
"""
