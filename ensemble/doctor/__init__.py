"""Which MPI, HDF5, FFTW and writer this installation has, tried out.

Import :func:`adhesis.ensemble.doctor.examine.examine`; :mod:`adhesis.ensemble.doctor.probe` runs in
its processes.
"""
