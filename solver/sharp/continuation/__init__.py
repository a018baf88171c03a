"""Continuation of stable branches: predictor, corrector, events, jumps."""
