"""Read a measured trace from a file, a stream, an array or a table.

Import from its modules; :func:`~adhesis.ensemble.trace.reading.measured_trace.read_trace` reads any
of them.
"""
