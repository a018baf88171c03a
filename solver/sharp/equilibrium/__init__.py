"""Points of a branch, the balance of the edges, and steps off a saddle."""
