"""Tests of the project as a whole: structure, documentation, set-up, package."""
