"""Loading paths through contact states: loops, several turning points, any path; their results."""
