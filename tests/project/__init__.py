"""Tests of the project as a whole: rooms, documentation, set-up, package."""
