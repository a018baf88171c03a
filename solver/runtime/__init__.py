"""The running program: compilation, its cache on disk, threads, signals, memory.

Import from its modules.
"""
