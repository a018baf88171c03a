"""The results file (HDF5): its schema, laying it out, writing and reading rows, status.

Import from its modules; nothing here knows ranks or what a row means.
"""
