"""All gaps on one tree, for any number of them, and one implicit flow; not the default yet."""

from __future__ import annotations
