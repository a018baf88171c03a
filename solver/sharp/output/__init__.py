"""Contact states and fields in SI units from a solution."""
