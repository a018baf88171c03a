"""Compute the loop of one task, (H, γ, realisation), as a row of results."""
