"""Measure speed against error of each method: scenes, runs in own processes, tables, figure.

Import from its modules. This one imports nothing: the memory of the measuring process is a result.
"""
