"""The solid that several tests use."""

from adhesis import HalfSpace

HALF_SPACE = HalfSpace(young=1e6, poisson=0.5)
