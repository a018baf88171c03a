"""Ensembles of loops over (Hurst exponent, work of adhesion, realisation): tasks, ranks, files."""
