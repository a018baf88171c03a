"""Describe a campaign: the campaign file, its tables and rules, its tasks.

Import from its modules; nothing here knows results files, ranks or contact mechanics.
"""
