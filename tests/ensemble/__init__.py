"""Tests of ``ensemble``."""
