"""The study of the paper's table: from results files to the numbers and figures of its pages.

It uses adhesis as a user does; nothing of adhesis imports it.
"""
