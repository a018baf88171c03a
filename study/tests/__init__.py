"""Tests of the study: ``make study``."""
