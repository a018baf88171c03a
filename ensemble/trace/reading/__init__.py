"""Read a measured trace from a file, a stream, an array or a table."""
