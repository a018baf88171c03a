"""One task: the loop of one (H, γ, realisation), computed and turned into a row of results.

Import from its modules; the only room of ``ensemble`` that runs loops of a campaign.
"""
