"""Test MPI, HDF5, FFTW and the writer of this installation.

Import :func:`adhesis.ensemble.doctor.examine.examine`; :mod:`adhesis.ensemble.doctor.probe` runs in
the processes that it starts.
"""
