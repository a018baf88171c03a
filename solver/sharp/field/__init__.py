"""Elastic field of given contact edges, by a dense matrix or on a tree of gaps.

Import from its modules.
"""
