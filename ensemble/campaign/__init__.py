"""Describe a campaign: the campaign file, its tables and rules, its tasks."""
