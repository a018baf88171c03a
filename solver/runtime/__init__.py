"""The running program: threads, signals, memory.

Import from its modules.
"""
