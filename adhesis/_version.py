"""The version, as in pyproject.toml: to ask the installation for it takes a tenth of a second."""

__version__ = "0.1.0"
