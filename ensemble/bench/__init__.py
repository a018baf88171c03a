"""Measure speed against error of each method: scenes, runs in own processes, tables, figure."""
