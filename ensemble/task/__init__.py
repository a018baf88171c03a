"""Compute the loop of one task, (H, γ, realisation), as a row of results.

Import from its modules; no other folder of ``ensemble`` runs the loops of a campaign.
"""
