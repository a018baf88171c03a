"""The results file (HDF5): its schema, laying it out, writing, reading and merging rows."""
