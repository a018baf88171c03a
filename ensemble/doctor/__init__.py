"""Which MPI, HDF5, FFTW and writer this installation has, tried out.

Import :func:`ensemble.doctor.examine.examine`; :mod:`ensemble.doctor.probe` runs in its processes.
"""
