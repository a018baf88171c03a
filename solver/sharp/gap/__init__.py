"""Ends of gaps, and the full-contact stress on panels."""
