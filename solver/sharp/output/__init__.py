"""Contact states and fields in SI units from a solution.

Import from its modules.
"""
