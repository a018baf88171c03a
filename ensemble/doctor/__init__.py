"""Test MPI, HDF5, FFTW and the writer of this installation, in processes of their own."""
