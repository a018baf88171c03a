"""Elastic field of given contact edges, on a tree of gaps."""
