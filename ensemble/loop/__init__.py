"""One loop without a campaign: what ``adhesis loop`` writes.

Import from its modules.
"""
