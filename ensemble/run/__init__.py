"""Run a campaign: session, hand-out to ranks, lock, signals, progress."""
