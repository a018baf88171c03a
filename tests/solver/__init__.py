"""Tests of ``solver``."""
