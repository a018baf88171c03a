"""The figures of the report, each drawn from an aggregate; their style."""
