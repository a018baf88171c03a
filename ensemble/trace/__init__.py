"""Compute the loss of a measured trace: reading, preparation, plan, uncertainty, page."""
