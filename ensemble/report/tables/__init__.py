"""The tables of the report: what a table is, and each table from an aggregate."""
