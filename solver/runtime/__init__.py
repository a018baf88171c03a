"""The running program: threads and signals."""
