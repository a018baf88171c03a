"""The running program: threads, signals, memory."""
