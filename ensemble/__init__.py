"""Ensembles of loops over (Hurst exponent, work of adhesion, realisation): tasks, ranks, files.

Knows nothing of contact mechanics beyond calling ``adhesis.solver``. Import from its folders; the
command line is :func:`adhesis.ensemble.command.main.main`.
"""
