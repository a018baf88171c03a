"""Speed against error of each method: scenes, runs in processes of their own, tables, figure.

Import from its modules; light, as the memory of the measuring process is part of the result.
"""
