"""Problem and its states: profile, half-space, control, problem, contact state, jump."""
