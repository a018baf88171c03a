"""Contact mechanics of rough periodic profiles with adhesion of zero range (JKR) or a short one.

Knows nothing of MPI, files or campaigns. Lengths in m, stresses in Pa (compression positive),
energies per unit depth in J/m, per nominal area in J/m². Import from its modules; what users need
is in :mod:`adhesis`.
"""
